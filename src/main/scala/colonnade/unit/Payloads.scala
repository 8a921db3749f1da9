package colonnade.unit

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, Pixel, RecordFormats}

/** A pixel to render. */
final class PixelPosition(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
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
  private def contexts = UInt(log2Ceil(config.array.contexts + 1).W)

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
  val positions  = Flipped(Decoupled(new PixelPosition(config)))
  val requests   = Decoupled(new RecordRequest(config))
  val broadcasts = Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config))))
  val pixels     = Decoupled(new Pixel(config))

  /** No pixel is in flight. */
  val isIdle = Output(Bool())
  val events = Output(new UnitEvents(config))
}
