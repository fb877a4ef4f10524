"""The data folder: frames and faces as files, what became of them in SQLite."""
