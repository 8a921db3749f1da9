package colonnade.frame

import chisel3._
import chisel3.util.{Decoupled, RegEnable}
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, FrameSettings, PixelPosition, PixelRect}

/** A square of pixels, named by its first pixel. */
final class TestedSquare(config: ColonnadeConfig) extends Bundle {
  val first = new PixelPosition(config)

  /** A pixel of it may show the object; a pixel of it may show the object or the environment. */
  val meetsObject = Bool()
  val isForUnits  = Bool()
}

/** The window of pixels that show the environment, if the frame has one. */
final class EnvironmentWindow(config: ColonnadeConfig) extends Bundle {
  val enabled = Bool()
  val rect    = new PixelRect(config.numbers.coordinateBits)

  /** A square of `size` pixels and the window have pixels in common. */
  def meets(first: PixelPosition, size: Int): Bool = enabled && EnvironmentWindow.meets(rect, first, size)
}

object EnvironmentWindow {

  /** The window in the registers. */
  def apply(config: ColonnadeConfig, registers: FrameRegisters): EnvironmentWindow = {
    val window = WireInit(0.U.asTypeOf(new EnvironmentWindow(config)))
    for (environment <- registers.environment) {
      window.enabled := environment.enabled
      window.rect    := environment.window
    }
    window
  }

  /** A square of `size` pixels and a rectangle have pixels in common. */
  def meets(rect: PixelRect, first: PixelPosition, size: Int): Bool = {
    def spans(first: UInt, low: UInt, high: UInt): Bool = low < high && first < high && first +& size.U > low
    spans(first.x, rect.x0, rect.x1) && spans(first.y, rect.y0, rect.y1)
  }
}

/** Ports of [[OutlineTest]]. */
final class OutlineTestIO(config: ColonnadeConfig) extends Bundle {
  val frame   = Input(new FrameSettings(config.numbers))
  val window  = Input(new EnvironmentWindow(config))
  val squares = Flipped(Decoupled(new PixelPosition(config)))
  val tested  = Decoupled(new TestedSquare(config))

  /** No square is inside. */
  val isIdle = Output(Bool())
}

/** Tests squares of `size` pixels against the object's rectangle and outline. A square meets the object unless it is
  * outside the rectangle or wholly outside the half-plane of one edge. Render units get the squares that meet the object
  * or the environment's window.
  *
  * Throughput: one square per cycle, in order. Latency: two cycles, for products and their sums.
  */
final class OutlineTest(config: ColonnadeConfig, size: Int) extends Module {
  val io = IO(new OutlineTestIO(config))

  private val rectangle = io.frame.objectRect
  private val outline   = io.frame.objectOutline

  // Handshake
  private val isMultiplied = RegInit(false.B)
  private val isTested     = RegInit(false.B)
  private val adds         = !isTested || io.tested.ready
  private val multiplies   = !isMultiplied || adds
  when(multiplies) { isMultiplied := io.squares.valid }
  when(adds) { isTested := isMultiplied }
  io.squares.ready := multiplies
  io.tested.valid  := isTested
  io.isIdle        := !isMultiplied && !isTested

  // Products of the corner that is farthest inside
  private val square   = io.squares.bits
  private val inRect   = EnvironmentWindow.meets(rectangle, square, size)
  private val inWindow = io.window.meets(square, size)
  private val products = outline.map { edge =>
    Seq(edge.x -> square.x, edge.y -> square.y).map { case (normal, first) =>
      val furthest = Mux(normal > 0.S, first +& (size - 1).U, first)
      RegEnable(normal * furthest.zext, multiplies)
    }
  }
  private val multiplied = RegEnable(square, multiplies)
  private val isInRect   = RegEnable(inRect, multiplies)
  private val isInWindow = RegEnable(inWindow, multiplies)

  // Sums
  private val isInside =
    outline.zip(products).map { case (edge, Seq(ofX, ofY)) => (ofX +& ofY) +& edge.offset >= 0.S }.reduce(_ && _)
  io.tested.bits.first       := RegEnable(multiplied, adds)
  io.tested.bits.meetsObject := RegEnable(isInRect && isInside, adds)
  io.tested.bits.isForUnits  := RegEnable((isInRect && isInside) || isInWindow, adds)
}
