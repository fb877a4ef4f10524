"""`denseface view`: a page of one's own machine that shows faces, frames and meshes; or rerun."""
