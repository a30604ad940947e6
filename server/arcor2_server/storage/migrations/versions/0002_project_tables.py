"""Tables for project parameters, tokens and breakpoints of the REST APIs."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "project_beside",
        sa.Column("id", sa.String(255), sa.ForeignKey("project.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("parameters", sa.LargeBinary(), nullable=False),
        sa.Column("object_parameters", sa.LargeBinary(), nullable=False),
    )
    op.create_table(
        "execution_token",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("access", sa.Boolean(), nullable=False),
    )
    op.create_table(
        "breakpoints",
        sa.Column("package_id", sa.String(255), primary_key=True),
        sa.Column("ids", sa.LargeBinary(), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    for table in ("breakpoints", "execution_token", "project_beside"):
        op.drop_table(table)
