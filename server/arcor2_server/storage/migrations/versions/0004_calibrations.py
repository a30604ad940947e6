"""Table for calibration records."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Migrate to this revision."""
    op.create_table(
        "calibration",
        sa.Column("id", sa.String(255), primary_key=True),
        sa.Column("date", sa.String(40), nullable=False),
        sa.Column("kind", sa.String(40), nullable=False),
        sa.Column("object_id", sa.String(255), nullable=False),
        sa.Column("document", sa.LargeBinary(), nullable=False),
    )
    op.create_index("ix_calibration_date", "calibration", ["date"])
    op.create_index("ix_calibration_object_id", "calibration", ["object_id"])


def downgrade() -> None:
    """Migrate back to the previous revision."""
    op.drop_table("calibration")
