"""The `.oni` file itself: its records read, put in order, mended and written, without OpenNI2.

OpenNI2 plays these files (`openni2`), but trusts them blindly, and its recorder loses what it was
recording when anything goes wrong. So a file is checked, and where necessary mended, before the
library sees it, and recordings are written here.
"""
