package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig

/** What happened in a render unit in one cycle; names as in `Counters`. */
final class UnitEvents(config: ColonnadeConfig) extends Bundle {
  private def contexts                               = UInt(log2Ceil(config.array.contexts + 1).W)
  private def ifRoom[T <: Data](event: T): Option[T] = if (config.hasRoom) Some(event) else None

  val raysShadow       = Bool()
  val raysReflection   = Bool()
  val raysRefraction   = Bool()
  val raysInBox        = Bool()
  val nodeReads        = Bool()
  val boxTests         = UInt(log2Ceil(config.geometry.arity + 1).W)
  val triangleTests    = Bool()
  val hits             = Bool()
  val snoopHits        = contexts
  val busyRaySetup     = Bool()
  val busyBoxUnit      = Bool()
  val busyTriangleUnit = UInt(log2Ceil(config.units.triangleLanes + 1).W)
  val busyShader       = Bool()

  /** Contexts without a pixel; whose ray is generated or set up; that wait for a record, or with it for a unit; in box
    * unit and stack; in the triangle unit; in the shader. The others are on their way out.
    */
  val idleContexts      = contexts
  val contextsSetUp     = contexts
  val waitRecord        = contexts
  val waitUnit          = contexts
  val contextsBox       = contexts
  val contextsTriangles = contexts
  val contextsShading   = contexts

  /** Rays that look for a point of the room, tiles and cells that they pass; the march is busy; contexts that wait for
    * it, or are in it.
    */
  val raysRoom     = ifRoom(Bool())
  val marchSteps   = ifRoom(Bool())
  val busyRoom     = ifRoom(Bool())
  val contextsRoom = ifRoom(contexts)

  /** Most entries that any of the unit's stacks has held since the frame's start: a level, not an event. */
  val deepestStack = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)

  /** Errors. */
  val stackOverflow = Bool()
  val illegalRecord = Bool()
}

/** Questions accepted in one cycle; names as in `Counters`. */
final class AttributeEvents extends Bundle {
  val albedoReads = Bool()
  val normalReads = Bool()
  val cellReads   = Bool()
  val planeReads  = Bool()
}
