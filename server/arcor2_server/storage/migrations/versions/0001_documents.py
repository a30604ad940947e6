"""First schema: tables for scenes, projects, sources, object types and collision models."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "scene",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("description", sa.Text(), nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("modified", sa.String(40), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_index("ix_scene_name", "scene", ["name"])
    op.create_table(
        "project",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("scene_id", sa.String(255), nullable=False),
        sa.Column("name", sa.Text(), nullable=False),
        sa.Column("description", sa.Text(), nullable=False),
        sa.Column("has_logic", sa.Boolean(), nullable=False),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("modified", sa.String(40), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_index("ix_project_name", "project", ["name"])
    op.create_index("ix_project_scene_id", "project", ["scene_id"])
    op.create_table(
        "project_source",
        sa.Column("id", sa.String(255), sa.ForeignKey("project.id", ondelete="CASCADE"), primary_key=True),
        sa.Column("script", sa.Text(), nullable=False),
    )
    op.create_table(
        "object_type",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("description", sa.Text()),
        sa.Column("source", sa.Text(), nullable=False),
        sa.Column("model_kind", sa.String(20)),
        sa.Column("created", sa.String(40), nullable=False),
        sa.Column("modified", sa.String(40), nullable=False),
    )
    op.create_table(
        "model",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("kind", sa.String(20), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )


def downgrade() -> None:
    """Migrate back to the previous revision."""
    for table in ("model", "object_type", "project_source", "project", "scene"):
        op.drop_table(table)
