"""Which triangle each pixel shows, by OpenGL: pyrender's offscreen context, and one shader that writes numbers.

pyrender draws colours, with anti-aliasing that mixes neighbouring ids and one upload of every mesh for each scene. Here
its EGL context is kept, meshes are uploaded once for each mesh set, all instances of a mesh are one draw call, and only
the number of the triangle is drawn.

Graphics cards round differently, so Mesa's software rasteriser draws, on machines with a card too.
"""

from __future__ import annotations

import ctypes
import os
from collections import OrderedDict
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from stages.shape.arrays import IntArray
from stages.shape.views.camera import View
from stages.shape.views.layers import layered_moves
from stages.shape.views.scene import MeshSet, Scene

KEPT_MESH_SETS = 8
"""Mesh sets that stay uploaded; the least recently used goes first."""

VERTEX_SHADER = """#version 330 core
layout(location = 0) in vec3 position;
layout(location = 1) in vec4 row0;
layout(location = 2) in vec4 row1;
layout(location = 3) in vec4 row2;
layout(location = 4) in int first;
uniform mat4 projection;
flat out int base;
void main() {
    vec4 local = vec4(position, 1.0);
    gl_Position = projection * vec4(dot(row0, local), dot(row1, local), dot(row2, local), 1.0);
    base = first;
}
"""

FRAGMENT_SHADER = """#version 330 core
flat in int base;
out int triangle;
void main() { triangle = base + gl_PrimitiveID; }
"""

INSTANCE = np.dtype([("rows", np.float32, (3, 4)), ("first", np.int32)])


SOFTWARE = {
    "PYOPENGL_PLATFORM": "egl",
    "LIBGL_ALWAYS_SOFTWARE": "1",
    "GALLIUM_DRIVER": "llvmpipe",
    "LP_NUM_THREADS": "0",
}
"""Environment that makes Mesa draw in software in the calling thread: there is one worker for each core."""

RASTERISER = "llvmpipe"
VENDORS = ("/etc/glvnd/egl_vendor.d", "/usr/share/glvnd/egl_vendor.d")
"""Folders in which each driver has a file for libEGL."""


def load_pyrender() -> Any:
    """Return the module `pyrender`, set to draw by Mesa's software rasteriser. Raises RuntimeError if it is missing.

    pyrender still uses a NumPy name that NumPy 2 dropped.
    """
    os.environ.update(SOFTWARE)
    mesa = [str(path) for folder in VENDORS for path in sorted(Path(folder).glob("*mesa*.json"))]
    if mesa:
        os.environ["__EGL_VENDOR_LIBRARY_FILENAMES"] = ":".join(mesa)
    vars(np).setdefault("infty", np.inf)
    import pyrender
    from pyrender.platforms import egl

    files = [device.name for device in egl.query_devices()]
    if None not in files:
        raise RuntimeError(f"EGL knows no device without a card, only {files}")
    os.environ["EGL_DEVICE_ID"] = str(files.index(None))
    return pyrender


@dataclass(frozen=True)
class _Mesh:
    """One uploaded mesh.

    array: vertex array
    buffers: its buffers, the last one for instances
    indices: number of indices
    """

    array: int
    buffers: tuple[int, int, int]
    indices: int


class OpenGLRenderer:
    """One OpenGL context. Raises RuntimeError if none can be created, or if anything but llvmpipe would draw."""

    def __init__(self) -> None:
        try:
            self._context = load_pyrender().OffscreenRenderer(16, 16)
            self._build()
        except Exception as error:
            raise RuntimeError(f"no OpenGL context on EGL: {type(error).__name__}: {error}") from error
        self.name = _renderer_name()
        if RASTERISER not in self.name:
            raise RuntimeError(f"{self.name} would draw, not Mesa's {RASTERISER}: other bytes than elsewhere")
        self._uploaded: OrderedDict[MeshSet, list[_Mesh]] = OrderedDict()
        self._size = (0, 0)
        self._targets: list[int] = []
        self._frame = 0

    def triangles(self, scene: Scene, view: View, width: int, height: int) -> IntArray:
        """Return the triangle that each pixel shows, int32 (height, width), -1 for none.

        Raises RuntimeError if the driver refuses: the context may be lost.
        """
        from OpenGL.error import Error

        try:
            return self._triangles(scene, view, width, height)
        except (Error, AssertionError) as error:
            raise RuntimeError(f"OpenGL: {error}") from error

    def _triangles(self, scene: Scene, view: View, width: int, height: int) -> IntArray:
        from OpenGL import GL

        self._context._platform.make_current()
        self._resize(width, height)
        meshes = self._meshes(scene.meshes)
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        GL.glViewport(0, 0, width, height)
        GL.glClearBufferiv(GL.GL_COLOR, 0, np.full(4, -1, dtype=np.int32))
        GL.glClearBufferfv(GL.GL_DEPTH, 0, np.ones(1, dtype=np.float32))
        GL.glUseProgram(self._program)
        GL.glUniformMatrix4fv(self._projection, 1, True, view.projection.astype(np.float32))
        instances = np.zeros(len(scene), dtype=INSTANCE)
        instances["rows"] = layered_moves(scene, view)[:, :3]
        instances["first"] = scene.triangle_first[:-1]
        for index in np.unique(scene.mesh_of).tolist():
            self._draw(meshes[index], instances[scene.mesh_of == index])
        pixels = np.empty((height, width), dtype=np.int32)
        GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 4)
        GL.glReadPixels(0, 0, width, height, GL.GL_RED_INTEGER, GL.GL_INT, pixels)
        return np.ascontiguousarray(pixels[::-1])

    def close(self) -> None:
        """Release the context."""
        self._context.delete()

    def _build(self) -> None:
        from OpenGL import GL

        self._program = GL.glCreateProgram()
        for kind, source in ((GL.GL_VERTEX_SHADER, VERTEX_SHADER), (GL.GL_FRAGMENT_SHADER, FRAGMENT_SHADER)):
            shader = GL.glCreateShader(kind)
            GL.glShaderSource(shader, source)
            GL.glCompileShader(shader)
            if not GL.glGetShaderiv(shader, GL.GL_COMPILE_STATUS):
                raise RuntimeError(GL.glGetShaderInfoLog(shader))
            GL.glAttachShader(self._program, shader)
        GL.glLinkProgram(self._program)
        if not GL.glGetProgramiv(self._program, GL.GL_LINK_STATUS):
            raise RuntimeError(GL.glGetProgramInfoLog(self._program))
        self._projection = GL.glGetUniformLocation(self._program, "projection")
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glDepthFunc(GL.GL_LESS)
        GL.glDisable(GL.GL_CULL_FACE)
        GL.glDisable(GL.GL_MULTISAMPLE)
        GL.glDisable(GL.GL_DITHER)

    def _resize(self, width: int, height: int) -> None:
        from OpenGL import GL

        if self._size == (width, height):
            return
        if self._targets:
            GL.glDeleteFramebuffers(1, [self._frame])
            GL.glDeleteRenderbuffers(2, self._targets)
        self._frame = GL.glGenFramebuffers(1)
        self._targets = [int(target) for target in GL.glGenRenderbuffers(2)]
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._frame)
        kinds = (GL.GL_COLOR_ATTACHMENT0, GL.GL_R32I), (GL.GL_DEPTH_ATTACHMENT, GL.GL_DEPTH_COMPONENT32F)
        for target, (attachment, content) in zip(self._targets, kinds, strict=True):
            GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, target)
            GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, content, width, height)
            GL.glFramebufferRenderbuffer(GL.GL_FRAMEBUFFER, attachment, GL.GL_RENDERBUFFER, target)
        if GL.glCheckFramebufferStatus(GL.GL_FRAMEBUFFER) != GL.GL_FRAMEBUFFER_COMPLETE:
            raise RuntimeError(f"OpenGL cannot draw integers on {width} x {height} pixels")
        self._size = (width, height)

    def _meshes(self, meshes: MeshSet) -> list[_Mesh]:
        from OpenGL import GL

        if meshes not in self._uploaded:
            if len(self._uploaded) == KEPT_MESH_SETS:
                for mesh in self._uploaded.popitem(last=False)[1]:
                    GL.glDeleteVertexArrays(1, [mesh.array])
                    GL.glDeleteBuffers(3, list(mesh.buffers))
            vertices, faces = meshes.vertices.astype(np.float32), meshes.faces
            ends = zip(pairwise(meshes.vertex_first.tolist()), pairwise(meshes.face_first.tolist()), strict=True)
            self._uploaded[meshes] = [_upload(vertices[a:b], faces[c:d] - np.int32(a)) for (a, b), (c, d) in ends]
        self._uploaded.move_to_end(meshes)
        return self._uploaded[meshes]

    def _draw(self, mesh: _Mesh, instances: np.ndarray) -> None:
        from OpenGL import GL

        GL.glBindVertexArray(mesh.array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, mesh.buffers[2])
        GL.glBufferData(GL.GL_ARRAY_BUFFER, instances.nbytes, instances.view(np.uint8), GL.GL_STREAM_DRAW)
        GL.glDrawElementsInstanced(
            GL.GL_TRIANGLES, mesh.indices, GL.GL_UNSIGNED_INT, ctypes.c_void_p(0), len(instances)
        )


def _renderer_name() -> str:
    """Return renderer and version as OpenGL names them."""
    from OpenGL import GL

    return ", ".join(GL.glGetString(name).decode() for name in (GL.GL_RENDERER, GL.GL_VERSION))


def _upload(vertices: np.ndarray, faces: IntArray) -> _Mesh:
    """Upload one mesh as a vertex array whose per-instance attributes come from its third buffer."""
    from OpenGL import GL

    array = GL.glGenVertexArrays(1)
    points, indices, instances = (int(buffer) for buffer in GL.glGenBuffers(3))
    vertices, faces = np.ascontiguousarray(vertices), np.ascontiguousarray(faces)
    GL.glBindVertexArray(array)
    GL.glBindBuffer(GL.GL_ARRAY_BUFFER, points)
    GL.glBufferData(GL.GL_ARRAY_BUFFER, vertices.nbytes, vertices, GL.GL_STATIC_DRAW)
    GL.glVertexAttribPointer(0, 3, GL.GL_FLOAT, False, 12, ctypes.c_void_p(0))
    GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, indices)
    GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, faces.nbytes, faces, GL.GL_STATIC_DRAW)
    GL.glBindBuffer(GL.GL_ARRAY_BUFFER, instances)
    for row in range(3):
        GL.glVertexAttribPointer(1 + row, 4, GL.GL_FLOAT, False, INSTANCE.itemsize, ctypes.c_void_p(16 * row))
    GL.glVertexAttribIPointer(4, 1, GL.GL_INT, INSTANCE.itemsize, ctypes.c_void_p(48))
    for attribute in range(5):
        GL.glEnableVertexAttribArray(attribute)
        GL.glVertexAttribDivisor(attribute, 1 if attribute else 0)
    return _Mesh(array, (points, indices, instances), faces.size)
