"""Table for the traces of runs."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "run_trace",
        sa.Column("run", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    op.drop_table("run_trace")
