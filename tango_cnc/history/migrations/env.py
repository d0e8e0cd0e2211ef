"""What Alembic runs: the steps, over the connection that the history hands to it."""

from alembic import context

context.configure(connection=context.config.attributes["connection"], transaction_per_migration=False)
context.run_migrations()
