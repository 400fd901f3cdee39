"""Texture of a mesh from panoramas: `python -m benchmarks.mesh_texturing [--data DIR]` prints one
JSON object.

Mesh, pictures, poses and texels are the same for all. ours: the charts as a run's stages of facades, walls, ground and
surfaces make them, in one process. plain: each texel from the panorama that shows it best, as it is. The figures of PyMeshLab's
"texture from registered rasters" that records and pages keep were measured by release 0.1.0, with PyMeshLab at its defaults,
16 perspective views of each panorama, and the mesh divided into faces of 1 m.

street: a painted street with truth, its middle panorama held out, and views of 90 degrees from there compared with the street
without the things that stand before it, poses true / refined from .3 m and 1 degree off without the one held out. perspective
pictures, with --perspective 60: the street by so many pictures of both sides, poses true / .1 m and .5 degrees off / refined
from there as a run does it, a panorama held out. amsterdam, with --data: each real panorama of the block at the IJ held out in
turn, poses refined with all three. By walls (with roofs), roofs and ground, seen by a picture with nothing in front, and
everywhere: share of the views; by method PSNR in dB and SSIM of brightness, a factor a channel aside. The same renderer draws
all. pose_errors: metres and degrees. cost: seconds, processor seconds and peak memory of texturing, MB, with the kernels of an
earlier run; without reading the block, and refining poses. same_bytes, with --twice: a second time made
the same.
"""
