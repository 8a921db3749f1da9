"""The light of a scene: lamps, what is around the objects, and the paths that find it."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Interval
from pydantic import Strict, StrictBool
from pydantic.dataclasses import dataclass

from colonnade.scene.model.values import (
    MAX_BOUNCES,
    STRICT,
    BrightColour,
    Diameter,
    File,
    Float,
    Fraction,
    LinearColour,
    WorldVector,
)
from colonnade.scene.samples import MAX_GATHERED


@dataclass(frozen=True, config=STRICT)
class PointLight:
    """A point light, at a position or relative to camera and object.

    Attributes:
        position: World position; None for a relative light.
        offset: From the centre of the object's cube, in edges of the cube: right, up, towards the camera.
        colour: Intensity per channel; at 1 a surface that faces the light has its albedo as colour.
        falloff: Distance of that intensity, world units. The intensity falls with the squared distance, up to four
            times brighter when nearer. None: constant intensity.
        radius: Radius of a light with an area, world units; 0: a point.
    """

    position: WorldVector | None = None
    offset: WorldVector = (1.2, 1.6, 1.5)
    colour: BrightColour = (0.9, 0.9, 0.9)
    falloff: Annotated[Float, Interval(ge=1e-6, le=1e6)] | None = None
    radius: Diameter = 0.0


@dataclass(frozen=True, config=STRICT)
class Light(PointLight):
    """The first light, with the settings of all lights.

    Attributes:
        shadows: Whether lights cast shadows.
        shadow_offset: Distance of the device's secondary rays' origins from the surface, in edges of the object's
            cube. None: the least one that its rounding allows (`colonnade.registers.surface_offset`).
    """

    shadows: StrictBool = True
    shadow_offset: Annotated[Float, Interval(ge=0.0, le=0.25)] | None = None


@dataclass(frozen=True, config=STRICT)
class Colour:
    """A linear colour; as ambient light it may be brighter than 1."""

    colour: BrightColour = (0.0, 0.0, 0.0)


@dataclass(frozen=True, config=STRICT)
class Background:
    """What rays see that miss the object: a room or one colour.

    Attributes:
        colour: Linear.
        room: The folder of a room, relative to the scene file.
        photo: In a room whose camera the scene places: the picture that this camera took, relative to the scene file.
            None: the room is drawn from its maps.
        occlusion: The room hides the object where it is nearer.
        second_view: The folder of another view of the room, in the same world, relative to the scene file: its photo is
            light around the object.
        panorama: An equirectangular picture of the light around the object, relative to the scene file, for
            directions that no photo shows.
        panorama_yaw: Rotation of the panorama about the world's y, degrees, as an object's turn; at 0 its middle looks
            along -z.
        panorama_exposure: Factor of its radiance. None: in a room with a photo, fitted where both show something; 1
            elsewhere.
        backdrop: Without a room, what is behind the object: the ``panorama``, or the ``colour``. None: the panorama if
            there is one.
        shadows: The object's shadow in a room's photo: ``photo``, none where the photo has a shadow of the room, or
            ``whole``. None: ``photo`` for lights that the scene does not name, if the room has an albedo map.
        colours: Colours of the room in reflections and refractions: ``photo``, its photo's, or ``albedo``, its
            albedo under the scene's lights. None: ``photo`` in a frame that shows the photo, else ``albedo``.
    """

    colour: LinearColour = (0.0, 0.0, 0.0)
    room: File | None = None
    photo: File | None = None
    occlusion: StrictBool = True
    second_view: File | None = None
    panorama: File | None = None
    panorama_yaw: Annotated[Float, Interval(ge=-360.0, le=360.0)] = 0.0
    panorama_exposure: Annotated[Float, Interval(ge=1e-6, le=1e6)] | None = None
    backdrop: Literal["panorama", "colour"] | None = None
    shadows: Literal["photo", "whole"] | None = None
    colours: Literal["photo", "albedo"] | None = None

    @property
    def shows_panorama(self) -> bool:
        """Whether frames that the host adds up show the panorama behind the object."""
        return self.panorama is not None and self.room is None and self.backdrop != "colour"


@dataclass(frozen=True, config=STRICT)
class Paths:
    """Settings of paths over mirrors and glass.

    Attributes:
        bounces: Traced reflections and refractions of a path; the ray after them sees the background only.
        shadow_transmittance: Fraction of light that a glass occluder transmits.
        gather: Rays that a path gathers at diffuse surfaces of the object, one after the other, each with the light
            that it meets; 0: every surface has the ambient light.
    """

    bounces: Annotated[int, Strict(), Interval(ge=0, le=MAX_BOUNCES)] = 4
    shadow_transmittance: Fraction = 0.3
    gather: Annotated[int, Strict(), Interval(ge=0, le=MAX_GATHERED)] = 0
