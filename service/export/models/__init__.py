"""Meshes as files of several parts: OBJ with its material, glTF plain, textured and compact."""
