package colonnade.environment

import colonnade.microcode.Label

/** Labels of [[EnvironmentMarch]]'s program. */
sealed trait MarchLabel extends Label

object MarchLabel {
  case object Idle extends MarchLabel // waits for a ray

  // RayProjection: scales the direction, then projects origin and direction, one matrix row at a time
  case object ProjectOrigin extends MarchLabel
  case object OriginDepth   extends MarchLabel
  case object ProjectDir    extends MarchLabel
  case object UvwRay        extends MarchLabel

  // RayClip: moves the origin of a camera's ray into the maps' frustum, plane by plane
  case object ClipPlane   extends MarchLabel
  case object MovedOrigin extends MarchLabel
  case object Rate        extends MarchLabel

  // DdaSetup: distances to tile edges, one axis at a time
  case object FirstTile extends MarchLabel
  case object AxisSetup extends MarchLabel
  case object NextAxis  extends MarchLabel
  case object Centre    extends MarchLabel

  // TileProgram: from tile to tile
  case object Tile         extends MarchLabel
  case object NearestPlane extends MarchLabel
  case object TilePassed   extends MarchLabel

  // CellProgram: from cell to cell within a tile of several planes
  case object Cells       extends MarchLabel
  case object FirstCell   extends MarchLabel
  case object CellEdge    extends MarchLabel
  case object Cell        extends MarchLabel
  case object CellPassed  extends MarchLabel
  case object CellsPassed extends MarchLabel

  case object Plane extends MarchLabel // PlaneCache: finds or fetches a plane, and computes its depth along the ray

  // PlaneTest: compares the ray with a plane
  case object PlaneDepth  extends MarchLabel
  case object Behind      extends MarchLabel
  case object Emerge      extends MarchLabel
  case object PlanePassed extends MarchLabel
  case object Crosses     extends MarchLabel
  case object Meets       extends MarchLabel

  // HitResolver: the hit's pixel and distance, or the nearest bounding plane
  case object Hit                extends MarchLabel
  case object HitDistance        extends MarchLabel
  case object BoundingPlanes     extends MarchLabel
  case object BoundingPlane      extends MarchLabel
  case object BoundingDepth      extends MarchLabel
  case object NextBoundingPlane  extends MarchLabel
  case object BoundingPlanesDone extends MarchLabel

  case object Pixel  extends MarchLabel // HitPixel: projects a point of the ray to a pixel
  case object Finish extends MarchLabel // offers the hit
  case object Texel  extends MarchLabel // fetches albedo and normal of a bounding plane
}
