package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameSettings, PixelPosition}

final class PixelTestIO(config: ColonnadeConfig) extends Bundle {
  val frame  = Input(new FrameSettings(config.numbers))
  val window = Input(new EnvironmentWindow(config))
  val pixels = Flipped(Decoupled(new PixelPosition(config)))

  /** Of the tile of `pixels`. */
  val edgeValues = Input(EdgeValues(config))
  val tested     = Decoupled(new TestedSquare(config))

  val isIdle = Output(Bool()) // no pixel is inside
}

/** Tests pixels of tiles that meet the object, like [[OutlineTest]]: exactly, but from the edge functions of the tile, so
  * that each product has as many digits as a position in the tile.
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

  /** A rising edge function is highest at the last position, another one at the first. The magnitude of a negative normal
    * is its complement and 1.
    */
  private def fall(normal: SInt, position: UInt): UInt = {
    val isNegative = normal < 0.S
    val steps      = Mux(isNegative, position, ~position)
    val complement = Mux(isNegative, ~normal, normal).asUInt.tail(1)
    complement * steps +& Mux(isNegative, steps, 0.U)
  }
}
