"""Texture of a mesh from panoramas, ours beside MeshLab's: `python -m benchmarks.mesh_texturing [--data DIR]` prints one
JSON object.

Mesh, pictures, poses and texels are the same for all. ours: the charts as a run's stages of facades, walls, ground and
surfaces make them, in one process. plain: each texel from the panorama that shows it best, as it is. meshlab: PyMeshLab's
"texture from registered rasters" at its defaults, of 16 perspective views of each panorama or of a perspective picture without
its distortion, and the mesh divided into faces of 1 m, as it takes each face from one picture; in an environment of its own
(deploy/peers/meshlab.txt), with Xvfb; skipped, with the reason, where that cannot run.

street: a painted street with truth, its middle panorama held out, and views of 90 degrees from there compared with the street
without the things that stand before it, poses true / refined from .3 m and 1 degree off without the one held out. perspective
pictures, with --perspective 60: the street by so many pictures of both sides, poses true / .1 m and .5 degrees off / refined
from there as a run does it, a panorama held out. amsterdam, with --data: each real panorama of the block at the IJ held out in
turn, poses refined with all three. By walls (with roofs), roofs and ground, seen by a picture with nothing in front, and
everywhere: share of the views; by method PSNR in dB and SSIM of brightness, a factor a channel aside. The same renderer draws
all. pose_errors: metres and degrees. cost: seconds, processor seconds and peak memory of texturing, MB, with the kernels of an
earlier run; without reading the block, refining poses and (meshlab) cutting views. same_bytes, with --twice: a second time made
the same.
"""
