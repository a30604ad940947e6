"""Alembic environment: applies the migrations over the connection given by storage/schema.py."""

from alembic import context

from arcor2_server.storage.models import Base

context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=Base.metadata,
    render_as_batch=True,
    transactional_ddl=True,
)
with context.begin_transaction():
    context.run_migrations()
