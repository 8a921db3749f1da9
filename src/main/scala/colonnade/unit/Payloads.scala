package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.background.AttributePort
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{FrameRegisters, Pixel, RecordFormats}

/** A pixel to render. */
class PixelPosition(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A pixel for a render unit. */
final class UnitPosition(config: ColonnadeConfig) extends PixelPosition(config) {

  /** It may see the object; a unit without a room gets no others. */
  val meetsObject = if (config.hasRoom) Some(Bool()) else None
}

/** A read that a render unit asks its column for. It may be withdrawn while it is not accepted. */
final class RecordRequest(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
}

/** A record that a bank has read, shown to all render units of the column for one cycle. */
final class RecordBroadcast(config: ColonnadeConfig) extends Bundle {
  val address = UInt(RecordFormats.addressBits(config).W)
  val record  = new RecordFormats(config).record

  /** The row that had asked for it. */
  val row = UInt(log2Ceil(config.array.rows.max(2)).W)
}

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

/** The ports of a render unit. `registers` are constant while a frame runs; `start` precedes its first pixel. */
final class RenderUnitIO(config: ColonnadeConfig) extends Bundle {
  val row        = Input(UInt(log2Ceil(config.array.rows.max(2)).W))
  val registers  = Input(new FrameRegisters(config))
  val start      = Input(Bool())
  val positions  = Flipped(Decoupled(new UnitPosition(config)))
  val requests   = Decoupled(new RecordRequest(config))
  val broadcasts = Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config))))
  val pixels     = Decoupled(new Pixel(config))

  /** To the maps of a room. */
  val maps =
    if (config.hasRoom) Some(new AttributePort(AttributeLayout.of(config), AttributePort.tagBits(config))) else None

  /** No pixel is in flight. */
  val isIdle = Output(Bool())
  val events = Output(new UnitEvents(config))
}
