package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.{AlbedoEntry, AttributeEvents, NormalEntry, ShellEntry}

/** A question, and the word by which its requester knows the answer. */
final class Tagged[T <: Data](private val kind: T, tagBits: Int) extends Bundle {
  val content = kind.cloneType
  val tag     = UInt(tagBits.W)
}

/** An answer, and the word by which its requester knows it. */
final class Answered[T <: Data](private val kind: T, tagBits: Int) extends Bundle {

  /** A word was read beyond the map's heap; the answer is what words of 0 make of it. */
  val isIllegal = Bool()
  val content   = kind.cloneType
  val tag       = UInt(tagBits.W)
}

/** Questions to a map and its answers, seen by who asks. Answers come in the order of questions, at any time after them,
  * and are always taken.
  */
final class AttributeChannel[Q <: Data, A <: Data](private val asked: Q, private val found: A, tagBits: Int)
    extends Bundle {
  val question = Decoupled(new Tagged(asked, tagBits))
  val answer   = Flipped(Valid(new Answered(found, tagBits)))
}

/** A pixel of the maps; whoever asks keeps it inside them. */
final class MapPixel(layout: AttributeLayout) extends Bundle {
  val x = UInt(layout.xBits.W)
  val y = UInt(layout.yBits.W)
}

/** Which planes? */
final class CellQuestion(layout: AttributeLayout) extends Bundle {
  val pixel = new MapPixel(layout)

  /** All planes of the pixel's tile; or else the one of its cell. */
  val wholeTile = Bool()
}

/** The planes of a tile, or that of a cell. */
final class CellAnswer(layout: AttributeLayout) extends Bundle {

  /** Log2 of the edge of the tile's cells in pixels; a flat tile is one cell. */
  val cellLog = UInt(CellAnswer.cellLogBits.W)

  /** 1, 2 or 4; of a cell 1. */
  val count = UInt(3.W)

  /** Beyond the count 0. */
  val ids = Vec(4, UInt(layout.planeIdBits.W))
}

object CellAnswer {

  /** A tile's edge is 2^5 at most. */
  val cellLogBits: Int = 3
}

/** An entry of the plane table or of the shell. */
final class PlaneQuestion(layout: AttributeLayout) extends Bundle {
  val isShell = Bool()
  val index   = UInt(layout.tableIndexBits.W)
}

/** All that a requester may ask. The channels are independent of each other; albedo and normal of a plane's answer say
  * something only of a shell entry.
  */
final class AttributePort(layout: AttributeLayout, tagBits: Int) extends Bundle {
  val albedo  = new AttributeChannel(new MapPixel(layout), new AlbedoEntry, tagBits)
  val normals = new AttributeChannel(new MapPixel(layout), new NormalEntry, tagBits)
  val cells   = new AttributeChannel(new CellQuestion(layout), new CellAnswer(layout), tagBits)
  val planes  = new AttributeChannel(new PlaneQuestion(layout), new ShellEntry, tagBits)

  /** Questions accepted in this cycle. */
  def events: AttributeEvents = {
    val events = Wire(new AttributeEvents)
    events.albedoReads := albedo.question.fire
    events.normalReads := normals.question.fire
    events.cellReads   := cells.question.fire
    events.planeReads  := planes.question.fire
    events
  }

  /** For a port without a requester. */
  def asksNothing(): Unit = {
    Seq(albedo, normals, cells, planes).foreach { channel =>
      channel.question.valid := false.B
      channel.question.bits  := DontCare
    }
  }
}

object AttributePort {

  /** A render unit's tag is the number of a context. */
  def tagBits(config: ColonnadeConfig): Int = log2Ceil(config.array.contexts.max(2))

  /** The port of a column, for all of its render units. */
  def ofColumn(config: ColonnadeConfig): AttributePort =
    new AttributePort(AttributeLayout.of(config), AttributeArbiter.tagBits(config.array.rows, tagBits(config)))
}
