"""Column for the modules that belong to an object type."""

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"


def upgrade() -> None:
    """Migrate to this revision."""
    op.add_column("object_type", sa.Column("modules", sa.LargeBinary(), nullable=True))


def downgrade() -> None:
    """Migrate back to the previous revision."""
    op.drop_column("object_type", "modules")
