package colonnade.background

import chisel3._
import chisel3.util.{log2Ceil, Decoupled}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{RoomView, ShellEntry, Vec3}
import colonnade.numbers.{Fixed, FixedPointFormat}

/** A ray that leaves the objects. */
final class MarchRequest(config: ColonnadeConfig) extends Bundle {
  private val numbers = config.numbers

  val context = UInt(log2Ceil(config.array.contexts.max(2)).W)

  /** Grid steps. */
  val origin = Vec3(new Fixed(FixedPointFormat.signed(numbers.sceneBits, numbers.gridFraction)))

  /** Of any length. */
  val towards = Vec3(SInt((numbers.shadeBits + 1).W))
}

/** What a ray meets in the room. */
object RoomKind {
  val bits: Int = 2

  val nothing: Int = 0
  val map:     Int = 1
  val shell:   Int = 2
}

/** The point of the room that a ray meets. Fields that its kind does not name are 0. */
final class MarchResult(config: ColonnadeConfig) extends Bundle {
  private val formats = new MarchFormats(config)
  private val layout  = AttributeLayout.of(config)

  val context = UInt(log2Ceil(config.array.contexts.max(2)).W)

  /** Of [[RoomKind]]. */
  val kind = UInt(RoomKind.bits.W)

  /** `map`: the pixel whose albedo and normal it has. */
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)

  /** `shell`: the entry that has them. */
  val entry = UInt(layout.shellIndexBits.W)

  /** `map`: on the extension of a surface that something else hides. */
  val isHidden = Bool()

  /** The way there is travel · 2^travelExponent times the ray's direction. */
  val travel         = UInt((formats.f + 1).W)
  val travelExponent = SInt(formats.exponentBits.W)

  /** Tiles and cells that the ray has passed. */
  val steps = UInt(formats.stepBits.W)
}

/** For the counters, in this cycle. */
final class MarchEvents extends Bundle {

  /** A tile or a cell is passed. */
  val step = Bool()
  val busy = Bool()
}

/** Ports of [[RoomMarch]]. */
final class RoomMarchIO(config: ColonnadeConfig) extends Bundle {
  private val layout = AttributeLayout.of(config)

  /** Constant while a ray marches. */
  val view    = Input(new RoomView(config.numbers))
  val request = Flipped(Decoupled(new MarchRequest(config)))
  val result  = Decoupled(new MarchResult(config))

  /** One question in flight at most; tags are 0. */
  val cells  = new AttributeChannel(new CellQuestion(layout), new CellAnswer(layout), RoomMarch.tagBits)
  val planes = new AttributeChannel(new PlaneQuestion(layout), new ShellEntry, RoomMarch.tagBits)
  val events = Output(new MarchEvents)
}
