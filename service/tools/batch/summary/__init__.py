"""The summary of an archive: a row for each frame in a file, a page of all, how far a run is.

`writer.SummaryWriter(folder)` is for the one process that gathers the rows: `known(source, frame)`
says what earlier runs made of a frame (state, output, attempts) or None, in memory that does not
grow with the rows and fastest in the order of sources; `add(*rows)` keeps rows at once, and of
rows of the same frame the last; `close()`, or the end of a `with` block, makes `summary.parquet`
whole. `page.write_html(folder)` makes `summary.html` of that file alone.
`progress.BatchProgress(total)` is told of each row by `add(row)`. `thumbnail.thumbnail(face or
frame)` is for the workers.
"""
