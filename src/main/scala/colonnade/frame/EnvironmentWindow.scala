package colonnade.frame

import chisel3._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{FrameRegisters, PixelPosition, PixelRect}

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
