package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, DecoupledIO, Queue}
import colonnade.common.Dispatcher
import colonnade.config.ColonnadeConfig
import colonnade.formats.FrameSettings

final class TileSchedulerIO(config: ColonnadeConfig, kind: TileKind.Value) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))
  val start  = Input(Bool()) // starts the tiles of a frame; only while idle

  /** Valid only where ready is set, see `Dispatcher`. */
  val tiles = Vec(config.array.columns, Decoupled(Tile(config, kind)))

  val isIdle = Output(Bool()) // no tile is left
}

/** Dispatches the tiles of a frame that are of one kind, in Morton order, to ready columns, round-robin. A
  * [[TileDivider]] may divide the object's tiles.
  *
  * Throughput: one tile per cycle while the queue holds tiles; the first one comes four cycles after the start. The
  * queue hides the cycles in which codes outside the frame are skipped: a column needs more cycles per tile than a skip
  * takes. A tile of another kind takes one cycle.
  */
final class TileScheduler(config: ColonnadeConfig, kind: TileKind.Value) extends Module {
  import TileScheduler._

  val io = IO(new TileSchedulerIO(config, kind))

  private val coordinateBits = config.numbers.coordinateBits
  private val pixelLevels    = Tile.pixelLevels(config)
  private val scan           = Module(new MortonScan(Tile.tileLevels(config)))
  private val outline        = Module(new OutlineTest(config))
  private val dispatch       = Module(new Dispatcher(Tile(config, kind), config.array.columns))

  scan.io.size.valid     := io.start
  scan.io.size.bits.wide := tilesIn(io.frame.pixelsWide)
  scan.io.size.bits.high := tilesIn(io.frame.pixelsHigh)

  outline.io.frame        := io.frame
  outline.io.window       := io.window
  outline.io.tiles.valid  := scan.io.cells.valid
  outline.io.tiles.bits.x := firstPixel(scan.io.cells.bits.x)
  outline.io.tiles.bits.y := firstPixel(scan.io.cells.bits.y)
  scan.io.cells.ready     := outline.io.tiles.ready

  private val tested     = outline.io.tested
  private val isSelected = kind match {
    case TileKind.OfObject      => tested.bits.meetsObject
    case TileKind.OfEnvironment => tested.bits.isForUnits && !tested.bits.meetsObject
    case TileKind.OfBackground  => !tested.bits.isForUnits
  }

  private val parts: DecoupledIO[Tile] = if (kind == TileKind.OfObject) {
    val divider = Module(new TileDivider(config)).io
    divider.frame                 := io.frame
    divider.divides               := divides(io.window)
    divider.tiles.bits.edgeValues := tested.bits.edgeValues
    select(divider.tiles)
    divider.parts
  } else {
    val tiles = Wire(Decoupled(new Tile(config)))
    select(tiles)
    tiles
  }
  dispatch.io.items <> Queue(parts, queueEntries)
  io.tiles <> dispatch.io.takers
  io.isIdle := scan.io.isIdle && outline.io.isIdle && !dispatch.io.items.valid

  private def select(tiles: DecoupledIO[Tile]): Unit = {
    tiles.valid  := tested.valid && isSelected
    tiles.bits.x := tested.bits.first.x
    tiles.bits.y := tested.bits.first.y
    tested.ready := tiles.ready || !isSelected
  }

  private def tilesIn(pixels: UInt): UInt = (pixels +& (config.frame.tileSize - 1).U) >> pixelLevels

  /** The bits above a coordinate's are 0, because a tile starts inside the frame. */
  private def firstPixel(cell: UInt): UInt = Cat(cell, 0.U(pixelLevels.W)).pad(coordinateBits)(coordinateBits - 1, 0)
}

object TileScheduler {

  /** Whether tiles of the object are divided: in frames with an environment, where few of them are most of the work. */
  def divides(window: EnvironmentWindow): Bool = window.enabled

  private val queueEntries = 4
}

final class TileDividerIO(config: ColonnadeConfig) extends Bundle {
  val frame   = Input(new FrameSettings(config.numbers))
  val divides = Input(Bool()) // off: tiles pass as they are
  val tiles   = Flipped(Decoupled(new ObjectTile(config)))
  val parts   = Decoupled(new ObjectTile(config))
}

/** Divides a tile into squares of [[TileDivider.edge]], in Morton order, without those outside the frame. So work that
  * is much in few tiles is shared by more columns.
  *
  * Throughput: a square per cycle. Combinational.
  */
final class TileDivider(config: ColonnadeConfig) extends Module {
  val io = IO(new TileDividerIO(config))

  private val levels   = Tile.pixelLevels(config) - log2Ceil(TileDivider.edge(config))
  private val part     = RegInit(0.U((2 * levels).W))
  private val isLast   = !io.divides || part.andR
  private val isInside = io.parts.bits.x < io.frame.pixelsWide && io.parts.bits.y < io.frame.pixelsHigh
  private val steps    = io.tiles.valid && (io.parts.ready || !isInside)
  when(steps) { part := Mux(isLast, 0.U, part + 1.U) }

  io.parts.valid  := io.tiles.valid && isInside
  io.parts.bits   := io.tiles.bits
  io.parts.bits.x := io.tiles.bits.x | (coordinate(0) << log2Ceil(TileDivider.edge(config)))
  io.parts.bits.y := io.tiles.bits.y | (coordinate(1) << log2Ceil(TileDivider.edge(config)))
  io.tiles.ready  := steps && isLast

  private def coordinate(axis: Int): UInt = Cat((0 until levels).reverse.map(level => part(2 * level + axis)))
}

object TileDivider {

  /** Of the squares that a tile is divided into, in pixels. */
  def edge(config: ColonnadeConfig): Int = config.frame.tileSize / 4
}
