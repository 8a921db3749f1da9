package colonnade.frame

import chisel3._
import chisel3.util.{log2Ceil, Decoupled, DecoupledIO, Fill, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, FrameSettings, HalfPlane, PixelPosition}

/** A square of pixels, named by its first pixel. */
sealed class TestedSquare(config: ColonnadeConfig) extends Bundle {
  val first = new PixelPosition(config)

  /** A pixel of it may show the object; a pixel of it may show the object or the environment. */
  val meetsObject = Bool()
  val isForUnits  = Bool()
}

/** A tile after its test. */
final class TestedTile(config: ColonnadeConfig) extends TestedSquare(config) {

  /** If it meets the object. */
  val edgeValues = EdgeValues(config)
}

/** The edge functions of the object's outline, x·`x` + y·`y` + `offset`, at the corner of a tile where each one is
  * highest.
  *
  * They are not below 0, since the tile meets the object. They saturate above what one can fall by within the tile.
  */
object EdgeValues {
  def apply(config: ColonnadeConfig): Vec[UInt] = Vec(FrameRegisters.outlineEdges, UInt(bits(config).W))

  /** Of `size` − 1 steps of at most 2^(`normalBits` − 1) in both directions. */
  def bits(config: ColonnadeConfig): Int = HalfPlane.normalBits + log2Ceil(config.frame.tileSize)
}

/** Two registered stages with a handshake; each one holds an item while the next one is not ready. */
private[frame] final class TwoStages(in: DecoupledIO[Data], out: DecoupledIO[Data]) {
  private val isInFirst  = RegInit(false.B)
  private val isInSecond = RegInit(false.B)

  /** The second stage takes the item of the first one; the first stage takes `in`. */
  val second: Bool = !isInSecond || out.ready
  val first:  Bool = !isInFirst || second
  val isIdle: Bool = !isInFirst && !isInSecond

  when(first) { isInFirst := in.valid }
  when(second) { isInSecond := isInFirst }
  in.ready  := first
  out.valid := isInSecond
}

final class OutlineTestIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))
  val tiles  = Flipped(Decoupled(new PixelPosition(config))) // the first pixels of tiles
  val tested = Decoupled(new TestedTile(config))
  val isIdle = Output(Bool())                                // no tile is inside
}

/** Tests tiles against the object's rectangle and outline. A tile meets the object unless it is outside the rectangle
  * or wholly outside the half-plane of one edge. Path tracers get the tiles that meet the object or the environment's
  * window.
  *
  * Throughput: one tile per cycle, in order. Latency: two cycles, for products and their sums.
  */
final class OutlineTest(config: ColonnadeConfig) extends Module {
  val io = IO(new OutlineTestIO(config))

  private val size    = config.frame.tileSize
  private val outline = io.frame.objectOutline
  private val stages  = new TwoStages(io.tiles, io.tested)
  io.isIdle := stages.isIdle

  // Products of the corner that is farthest inside
  private val tile     = io.tiles.bits
  private val products = outline.map { edge =>
    Seq(edge.x -> tile.x, edge.y -> tile.y).map { case (normal, first) =>
      val furthest = Mux(normal > 0.S, first +& (size - 1).U, first)
      RegEnable(normal * furthest.zext, stages.first)
    }
  }
  private val multiplied = RegEnable(tile, stages.first)
  private val isInRect   = RegEnable(EnvironmentWindow.meets(io.frame.objectRect, tile, size), stages.first)
  private val isInWindow = RegEnable(io.window.meets(tile, size), stages.first)

  // Sums
  private val values   = outline.zip(products).map { case (edge, Seq(ofX, ofY)) => (ofX +& ofY) +& edge.offset }
  private val isInside = values.map(_ >= 0.S).reduce(_ && _)
  private val bits     = EdgeValues.bits(config)
  io.tested.bits.first       := RegEnable(multiplied, stages.second)
  io.tested.bits.meetsObject := RegEnable(isInRect && isInside, stages.second)
  io.tested.bits.isForUnits  := RegEnable((isInRect && isInside) || isInWindow, stages.second)
  for ((port, value) <- io.tested.bits.edgeValues.zip(values)) {
    val isLarge = (value >> bits).asUInt.orR
    port := RegEnable(Mux(isLarge, Fill(bits, true.B), value(bits - 1, 0)), stages.second)
  }
}

final class PixelTestIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))
  val pixels = Flipped(Decoupled(new PixelPosition(config)))

  /** Of the tile of `pixels`. */
  val edgeValues = Input(EdgeValues(config))
  val tested     = Decoupled(new TestedSquare(config))

  val isIdle = Output(Bool()) // no pixel is inside
}

/** Tests pixels of tiles that meet the object, like [[OutlineTest]]: exactly, but from the edge functions of the tile,
  * so that each product has as many digits as a position in the tile.
  *
  * Throughput: one pixel per cycle, in order. Latency: two cycles, for sums of products and comparisons.
  */
final class PixelTest(config: ColonnadeConfig) extends Module {
  val io = IO(new PixelTestIO(config))

  private val stages = new TwoStages(io.pixels, io.tested)
  io.isIdle := stages.isIdle

  // By how much each edge function falls from the corner where it is highest: two products of few digits, as one sum
  private val pixel = io.pixels.bits
  private val falls = io.frame.objectOutline.map { edge =>
    Seq(edge.x -> pixel.x, edge.y -> pixel.y).map { case (normal, position) =>
      RegEnable(fall(normal, position(Tile.pixelLevels(config) - 1, 0)), stages.first)
    }.reduce(_ +& _)
  }
  private val multiplied = RegEnable(pixel, stages.first)
  private val edgeValues = RegEnable(io.edgeValues, stages.first)
  private val isInRect   = RegEnable(EnvironmentWindow.meets(io.frame.objectRect, pixel, 1), stages.first)
  private val isInWindow = RegEnable(io.window.meets(pixel, 1), stages.first)

  // Compare
  private val isInside = edgeValues.zip(falls).map { case (value, fall) => value >= fall }.reduce(_ && _)
  io.tested.bits.first       := RegEnable(multiplied, stages.second)
  io.tested.bits.meetsObject := RegEnable(isInRect && isInside, stages.second)
  io.tested.bits.isForUnits  := RegEnable((isInRect && isInside) || isInWindow, stages.second)

  /** A rising edge function is highest at the last position, another one at the first. The magnitude of a negative
    * normal is its complement and 1.
    */
  private def fall(normal: SInt, position: UInt): UInt = {
    val isNegative = normal < 0.S
    val steps      = Mux(isNegative, position, ~position)
    val complement = Mux(isNegative, ~normal, normal).asUInt.tail(1)
    complement * steps +& Mux(isNegative, steps, 0.U)
  }
}
