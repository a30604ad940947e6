"""Tables for view values, shared breakpoints and runs."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "view_value",
        sa.Column("user", sa.String(255), primary_key=True),
        sa.Column("document", sa.String(255), primary_key=True),
        sa.Column("key", sa.String(255), primary_key=True),
        sa.Column("value", sa.LargeBinary(), nullable=False),
        sa.Column("revision", sa.BigInteger(), nullable=False),
    )
    op.create_index("ix_view_value_document", "view_value", ["document"])
    op.create_table(
        "shared_breakpoints",
        sa.Column("project_id", sa.String(255), primary_key=True),
        sa.Column("ids", sa.LargeBinary(), nullable=False),
        sa.Column("user", sa.Text(), nullable=False),
    )
    op.create_table(
        "run",
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    for table in ("run", "shared_breakpoints", "view_value"):
        op.drop_table(table)
