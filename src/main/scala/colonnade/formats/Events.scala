package colonnade.formats

import chisel3._
import chisel3.util.log2Ceil
import colonnade.config.ColonnadeConfig

/** Events of a render unit in one cycle; names as in `Counters`. */
final class UnitEvents(config: ColonnadeConfig) extends Bundle {
  private def contexts                               = UInt(log2Ceil(config.array.contexts + 1).W)
  private def ifRoom[T <: Data](event: T): Option[T] = if (config.hasEnvironment) Some(event) else None

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

  /** Numbers of contexts by state: without a pixel; in ray generation or set-up; waiting for a record; waiting with their
    * record for a unit; in box unit and stack; in the triangle unit; in the shader. The others are in later stages.
    */
  val idleContexts      = contexts
  val contextsRaySetup     = contexts
  val waitRecord        = contexts
  val waitUnit          = contexts
  val contextsBox       = contexts
  val contextsTriangles = contexts
  val contextsShading   = contexts

  /** With an environment: rays that start the march; tiles and cells that they visit; the march is busy; contexts that
    * wait for it or are in it.
    */
  val raysEnvironment     = ifRoom(Bool())
  val marchSteps   = ifRoom(Bool())
  val busyEnvironment     = ifRoom(Bool())
  val contextsEnvironment = ifRoom(contexts)

  /** The maximum number of entries of any stack of the unit since the start of the frame: a level, not an event. */
  val deepestStack = UInt(log2Ceil(config.columnBvhMemory.stackDepth + 1).W)

  /** Errors. */
  val stackOverflow = Bool()
  val illegalRecord = Bool()
}

/** Reads of the maps that are accepted in one cycle; names as in `Counters`. */
final class AttributeEvents extends Bundle {
  val albedoReads = Bool()
  val normalReads = Bool()
  val cellReads   = Bool()
  val planeReads  = Bool()
}
