package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Cat, Decoupled, DecoupledIO, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition}

/** The first pixel of a square of `frame.tileSize`, or of one of the squares of [[TileDivider]]. */
sealed class Tile(config: ColonnadeConfig) extends Bundle {
  val x = UInt(config.numbers.coordinateBits.W)
  val y = UInt(config.numbers.coordinateBits.W)
}

/** A tile, or a square of one, that meets the object. */
final class ObjectTile(config: ColonnadeConfig) extends Tile(config) {

  /** The bounds of the whole tile. */
  val edgeValues = EdgeValues(config)
}

object Tile {
  def apply(config: ColonnadeConfig, kind: TileKind.Value): Tile =
    if (kind == TileKind.OfObject) new ObjectTile(config) else new Tile(config)

  /** Levels of the Morton code of a pixel in its tile. */
  def pixelLevels(config: ColonnadeConfig): Int = log2Ceil(config.frame.tileSize)

  /** Levels of the Morton code of a tile, for any frame that the registers can hold. */
  def tileLevels(config: ColonnadeConfig): Int = (config.numbers.coordinateBits - pixelLevels(config)).max(1)
}

/** What the pixels of a tile may show. */
object TileKind extends Enumeration {
  val OfObject      = Value // the object in some pixel
  val OfEnvironment = Value // the environment in some pixel, the object in none
  val OfBackground  = Value // the background only

  /** The bounds of a device. */
  def all(config: ColonnadeConfig): Seq[TileKind.Value] =
    values.toSeq.filter(kind => kind != OfEnvironment || config.hasEnvironment)
}

/** Tiles for a column, by kind. */
final class ColumnTiles(config: ColonnadeConfig) extends Bundle {
  val ofObject      = Decoupled(new ObjectTile(config))
  val ofEnvironment = Option.when(config.hasEnvironment)(Decoupled(new Tile(config)))
  val ofBackground  = Decoupled(new Tile(config))

  def apply(kind: TileKind.Value): DecoupledIO[Tile] = kind match {
    case TileKind.OfObject      => ofObject
    case TileKind.OfEnvironment => ofEnvironment.get
    case TileKind.OfBackground  => ofBackground
  }
}

final class TileScanIO(config: ColonnadeConfig) extends Bundle {
  val frame     = Input(new FrameSettings(config.numbers))
  val isDivided = Input(Bool())  // tiles are squares of a [[TileDivider]]
  val tiles     = Flipped(Decoupled(new Tile(config)))
  val positions = Decoupled(new PixelPosition(config))
  val isIdle    = Output(Bool()) // no pixel is left
}

/** The pixels of a tile, clipped at the frame's edge, in Morton order.
  *
  * Throughput: one pixel per cycle. The next tile is accepted with the last pixel of the current one, so tiles follow
  * each other without a gap.
  */
final class TileScan(config: ColonnadeConfig) extends Module {
  val io = IO(new TileScanIO(config))

  private val scan = Module(new MortonScan(Tile.pixelLevels(config)))
  private val tile = RegEnable(io.tiles.bits, io.tiles.fire)

  scan.io.size.valid     := io.tiles.valid
  scan.io.size.bits.wide := clipped(io.frame.pixelsWide, io.tiles.bits.x)
  scan.io.size.bits.high := clipped(io.frame.pixelsHigh, io.tiles.bits.y)
  io.tiles.ready         := scan.io.size.ready

  io.positions.valid  := scan.io.cells.valid
  io.positions.bits.x := tile.x | scan.io.cells.bits.x
  io.positions.bits.y := tile.y | scan.io.cells.bits.y
  scan.io.cells.ready := io.positions.ready
  io.isIdle           := scan.io.isIdle

  /** The size of a tile in one direction. */
  private def clipped(frame: UInt, first: UInt): UInt = {
    val size = Mux(io.isDivided, TileDivider.edge(config).U, config.frame.tileSize.U)
    val left = frame - first
    Mux(left < size, left, size)
  }
}

/** Cells of a grid in each direction, up to 2^levels. */
final class GridSize(levels: Int) extends Bundle {
  val wide = UInt((levels + 1).W)
  val high = UInt((levels + 1).W)
}

final class GridCell(levels: Int) extends Bundle {
  val x = UInt(levels.W)
  val y = UInt(levels.W)
}

final class MortonScanIO(levels: Int) extends Bundle {
  val size   = Flipped(Decoupled(new GridSize(levels)))
  val cells  = Decoupled(new GridCell(levels))
  val isIdle = Output(Bool()) // no cell is left
}

/** Scans the cells of a grid in Morton order, so that consecutive cells are close to each other.
  *
  * Throughput: one cell per cycle, the first one in the cycle after the grid is accepted. The next grid is accepted
  * with the last step of the current one. Codes outside the grid are skipped in whole blocks, at most three per level
  * between two cells. An empty grid gives no cell.
  */
final class MortonScan(levels: Int) extends Module {
  val io = IO(new MortonScanIO(levels))

  private val isBusy = RegInit(false.B)
  private val size   = Reg(new GridSize(levels))
  private val code   = Reg(UInt((2 * levels).W))

  private val cell = Wire(new GridCell(levels))
  cell.x := Cat((0 until levels).reverse.map(level => code(2 * level)))
  cell.y := Cat((0 until levels).reverse.map(level => code(2 * level + 1)))
  private val isInside = cell.x < size.wide && cell.y < size.high

  // A block whose first cell is outside is wholly outside: skip the largest block that starts here.
  private val digits = Cat((0 until levels).reverse.map(level => code(2 * level + 1, 2 * level).orR))
  private val lowest = digits & (0.U - digits)
  private val block  = Cat((0 until levels).reverse.map(level => Cat(0.U(1.W), lowest(level))))
  private val next   = code +& Mux(isInside, 1.U, block)

  private val isLast = next(2 * levels) || (!isInside && !digits.orR)
  private val steps  = isBusy && (!isInside || io.cells.ready)

  io.cells.valid := isBusy && isInside
  io.cells.bits  := cell
  io.size.ready  := !isBusy || (steps && isLast)
  io.isIdle      := !isBusy

  when(io.size.fire) {
    isBusy := true.B
    size   := io.size.bits
    code   := 0.U
  }.elsewhen(steps) {
    isBusy := !isLast
    code   := next
  }
}
