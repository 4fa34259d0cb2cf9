//! Mesh files: PLY, OBJ, STL, GLB.
