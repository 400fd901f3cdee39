"""Optional detection of faces, number plates and text by models from installed packages."""
