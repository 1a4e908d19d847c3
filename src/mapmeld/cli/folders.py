"""Folders of results, as the commands write them."""

from mapmeld.io.folders import FolderError, check_folder, whole_folder

__all__ = ["FolderError", "check_folder", "whole_folder"]
