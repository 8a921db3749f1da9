package colonnade.environment

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, Pipe, Queue, RegEnable, Valid}
import colonnade.config.{ColonnadeConfig, TileGrid}
import colonnade.formats.Load

/** A pixel with sideband data. */
final class TaggedPixel[T <: Data](layout: TileGrid, private val extra: T) extends Bundle {
  val pixel    = new MapPixel(layout)
  val sideband = extra.cloneType
}

/** A tile's descriptor and the pixel's position in the tile. */
final class PixelInTile[D <: Data, T <: Data](layout: TileGrid, private val kind: D, private val extra: T)
    extends Bundle {
  val descriptor = kind.cloneType
  val x          = UInt(layout.tileLog.W)
  val y          = UInt(layout.tileLog.W)
  val sideband   = extra.cloneType

  /** Index of the pixel's cell, row by row, where a tile has 2^log cells along each edge. */
  def cell(log: Int): UInt = Cat(Seq(y, x).map(position => position(position.getWidth - 1, position.getWidth - log)))
}

/** Ports of [[TileLookup]]; D is the descriptor, T the sideband data. */
final class TileLookupIO[D <: Data, T <: Data](config: ColonnadeConfig, layout: TileGrid, descriptor: D, sideband: T)
    extends Bundle {
  val load  = Flipped(Valid(new Load(config)))
  val pixel = Flipped(Decoupled(new TaggedPixel(layout, sideband)))
  val tile  = Decoupled(new PixelInTile(layout, descriptor, sideband))
}

/** Looks up the descriptor of a pixel's tile. Latency three cycles, one pixel a cycle, in order. A pixel is accepted only
  * if there is space for its tile in the output queue, so a stalled output never loses one.
  *
  * @param memory name of the descriptors' memory
  */
final class TileLookup[D <: Data, T <: Data](
    config:     ColonnadeConfig,
    layout:     TileGrid,
    memory:     String,
    descriptor: D,
    sideband:   T
) extends Module {
  val io = IO(new TileLookupIO(config, layout, descriptor, sideband))

  private val descriptors = AttributeStore(config, memory, io.load)
  private val pixel       = io.pixel.bits.pixel
  private val found       = Wire(Decoupled(chiselTypeOf(io.tile.bits)))

  // Accept pixels while the output queue has space
  private val queueDepth = TileLookup.latency + 1
  private val inFlight   = RegInit(0.U(log2Ceil(queueDepth + 1).W))
  inFlight       := inFlight + io.pixel.fire - io.tile.fire
  io.pixel.ready := inFlight =/= queueDepth.U
  assert(!io.pixel.fire || (pixel.x < layout.mapWidth.U && pixel.y < layout.mapHeight.U), "a pixel outside the map")

  // Read its tile's descriptor
  private val tile    = (pixel.y >> layout.tileLog) * layout.tileColumns.U + (pixel.x >> layout.tileLog)
  private val request = Pipe(io.pixel.fire, io.pixel.bits)
  descriptors.read.valid := request.valid
  descriptors.read.bits  := RegEnable(tile(layout.tileBits - 1, 0), io.pixel.fire)

  // Queue it
  private val read = Pipe(request)
  found.valid           := read.valid
  found.bits.descriptor := descriptors.word.asTypeOf(descriptor)
  found.bits.x          := read.bits.pixel.x
  found.bits.y          := read.bits.pixel.y
  found.bits.sideband   := read.bits.sideband
  assert(!read.valid || found.ready, "a tile without space")
  io.tile <> Queue(found, queueDepth)
}

object TileLookup {
  val latency: Int = 3
}
