"""A table for the units and alarms that the broker has not stored yet."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "outbox",
        sa.Column("number", sa.BigInteger(), primary_key=True, autoincrement=False),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("record", sa.Integer(), nullable=False),
        sa.UniqueConstraint("kind", "record"),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    op.drop_table("outbox")
