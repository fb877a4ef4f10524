"""The operator's page: who may see it, and what it shows and does."""
