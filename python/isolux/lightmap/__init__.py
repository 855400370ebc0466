"""Lightmaps: a solution's light as pictures, with texture coordinates for every surface."""

from isolux.lightmap.baking import Part, Stage, Values, bake, manifest_of

__all__ = ["Part", "Stage", "Values", "bake", "manifest_of"]
