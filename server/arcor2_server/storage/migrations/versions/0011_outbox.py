"""A table for the units that the broker of the fleet has not stored yet."""

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "outbox",
        sa.Column("number", sa.BigInteger(), primary_key=True, autoincrement=False),
        sa.Column("unit", sa.Integer(), nullable=False, unique=True),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    op.drop_table("outbox")
