"""Tables for recipes, changeovers, records of units, and the activity of the cell."""

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "recipe",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "changeover",
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "unit",
        sa.Column("number", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("serial", sa.String(255), nullable=False, index=True),
        sa.Column("order_id", sa.String(255), nullable=False, index=True),
        sa.Column("product", sa.String(255), nullable=False),
        sa.Column("state", sa.String(20), nullable=False),
        sa.Column("entered", sa.String(40), nullable=False, index=True),
        sa.Column("left", sa.String(40), nullable=True, index=True),
        sa.Column("planned_rate", sa.Double(), nullable=True),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "unit_run",
        sa.Column("unit", sa.Integer(), primary_key=True, autoincrement=False),
        sa.Column("run", sa.Integer(), primary_key=True, autoincrement=False, index=True),
    )
    op.create_table(
        "cell_time",
        sa.Column("start", sa.Double(), primary_key=True),
        sa.Column("end", sa.Double(), nullable=False, index=True),
        sa.Column("activity", sa.String(20), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    for table in ("cell_time", "unit_run", "unit", "changeover", "recipe"):
        op.drop_table(table)
