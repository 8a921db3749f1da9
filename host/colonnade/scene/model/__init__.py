"""The scene model, which is also the schema of the scene file: its keys, ranges and defaults.

Colours and intensities are linear. Lengths are in world units, which are the mesh's units unless ``[transform]`` scales
them. Values are checked when a scene is constructed, from a file or in code; unknown keys are refused.
"""

from colonnade.scene.model.camera import Camera, CameraKey, FrameSize, Motion
from colonnade.scene.model.light import Background, Colour, Light, Paths, PointLight
from colonnade.scene.model.objects import Material, MeshSource, ObjectKey, Placement, SceneObject, Transform
from colonnade.scene.model.scene import Scene, interpolate
from colonnade.scene.model.values import MAX_BOUNCES, MAX_EDGE, MAX_OBJECTS, Denoiser, Vector

__all__ = [
    "MAX_BOUNCES",
    "MAX_EDGE",
    "MAX_OBJECTS",
    "Background",
    "Camera",
    "CameraKey",
    "Colour",
    "Denoiser",
    "FrameSize",
    "Light",
    "Material",
    "MeshSource",
    "Motion",
    "ObjectKey",
    "Paths",
    "Placement",
    "PointLight",
    "Scene",
    "SceneObject",
    "Transform",
    "Vector",
    "interpolate",
]
