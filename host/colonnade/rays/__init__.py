"""Rays of an application: hits with triangle meshes, by the bit-exact model or the simulated device."""

from colonnade.rays.intersector import RayMeshIntersector
from colonnade.rays.scene import Hits, Scene
from colonnade.rays.sensor import Sensor
from colonnade.rays.shell import RayShell
from colonnade.rays.traffic import Traffic

__all__ = ["Hits", "RayMeshIntersector", "RayShell", "Scene", "Sensor", "Traffic"]
