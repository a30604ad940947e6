"""Tables for the identities of devices and backups of their parameters."""

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "device",
        sa.Column("object_id", sa.String(255), primary_key=True),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "parameter_backup",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("object_id", sa.String(255), nullable=False, index=True),
        sa.Column("info", sa.LargeBinary(), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    for table in ("parameter_backup", "device"):
        op.drop_table(table)
