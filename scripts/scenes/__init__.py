"""The scenes of lightprobe: geometry, GLB writer, one module a group of scenes, and the checks on what was written."""
