"""Tables for persons and their lock-outs."""

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "person",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "person_lock_out",
        sa.Column("person", sa.String(255), primary_key=True),
        sa.Column("device", sa.String(255), primary_key=True),
        sa.Column("wrong", sa.Integer(), nullable=False),
        sa.Column("until", sa.Double(), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    op.drop_table("person_lock_out")
    op.drop_table("person")
