package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Pipe, Queue, RegEnable, Valid}
import colonnade.config.{AttributeLayout, ColonnadeConfig}
import colonnade.formats.Load

/** A pixel, and what goes along with it. */
final class RiddenPixel[T <: Data](layout: AttributeLayout, private val extra: T) extends Bundle {
  val pixel = new MapPixel(layout)
  val rider = extra.cloneType
}

/** A tile's descriptor and the pixel's place in the tile. */
final class PixelInTile[D <: Data, T <: Data](layout: AttributeLayout, private val kind: D, private val extra: T)
    extends Bundle {
  val descriptor = kind.cloneType
  val x          = UInt(layout.tileLog.W)
  val y          = UInt(layout.tileLog.W)
  val rider      = extra.cloneType

  /** Index of the pixel's cell, row by row, where a tile has 2^log cells along each edge. */
  def cell(log: Int): UInt = Cat(Seq(y, x).map(place => place(place.getWidth - 1, place.getWidth - log)))
}

/** Ports of [[TileLookup]]; D is the descriptor, T what goes along with a pixel. */
final class TileLookupIO[D <: Data, T <: Data](config: ColonnadeConfig, descriptor: D, rider: T) extends Bundle {
  private val layout = AttributeLayout.of(config)

  val load  = Flipped(Valid(new Load(config)))
  val pixel = Flipped(Decoupled(new RiddenPixel(layout, rider)))
  val tile  = Decoupled(new PixelInTile(layout, descriptor, rider))
}

/** Finds the descriptor of the tile that a pixel lies in. Latency three cycles, one pixel a cycle, in order: a pixel is
  * accepted when there is room for its tile, whoever takes tiles and when.
  *
  * @param memory name of the descriptors' memory
  */
final class TileLookup[D <: Data, T <: Data](config: ColonnadeConfig, memory: String, descriptor: D, rider: T)
    extends Module {
  val io = IO(new TileLookupIO(config, descriptor, rider))

  private val layout      = AttributeLayout.of(config)
  private val descriptors = AttributeStore(config, memory, io.load)
  private val pixel       = io.pixel.bits.pixel
  private val found       = Wire(Decoupled(chiselTypeOf(io.tile.bits)))

  // Take what there is room for
  private val room     = TileLookup.latency + 1
  private val inFlight = RegInit(0.U(log2Ceil(room + 1).W))
  inFlight       := inFlight + io.pixel.fire - io.tile.fire
  io.pixel.ready := inFlight =/= room.U
  assert(
    !io.pixel.fire || (pixel.x < layout.config.width.U && pixel.y < layout.config.height.U),
    "a pixel outside the map"
  )

  // Read its tile's descriptor
  private val tile  = (pixel.y >> layout.tileLog) * layout.tileColumns.U + (pixel.x >> layout.tileLog)
  private val asked = Pipe(io.pixel.fire, io.pixel.bits)
  descriptors.read.valid := asked.valid
  descriptors.read.bits  := RegEnable(tile(layout.tileBits - 1, 0), io.pixel.fire)

  // Keep it until it is taken
  private val read = Pipe(asked)
  found.valid           := read.valid
  found.bits.descriptor := descriptors.word.asTypeOf(descriptor)
  found.bits.x          := read.bits.pixel.x
  found.bits.y          := read.bits.pixel.y
  found.bits.rider      := read.bits.rider
  assert(!read.valid || found.ready, "a tile without room")
  io.tile <> Queue(found, room)
}

object TileLookup {
  val latency: Int = 3
}
