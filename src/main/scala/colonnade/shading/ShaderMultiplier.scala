package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, ShiftRegister, Valid}
import colonnade.common.TimingSlice
import colonnade.config.PathConfig

final class ShaderMultiplierIO(formats: ShaderFormats, hasCornerColours: Boolean) extends Bundle {
  val geometry = Flipped(Valid(new MultiplierOperands(formats)))     // has priority; never waits
  val colour   = Flipped(Decoupled(new MultiplierOperands(formats))) // uses the cycles that the geometry leaves free

  /** Uses the cycles that both leave free. */
  val corners = if (hasCornerColours) Some(Flipped(Decoupled(new MultiplierOperands(formats)))) else None

  val product = Output(SInt(formats.productBits.W)) // of the operands `latency` cycles before; for one cycle
}

/** The shader's only multiplier; exact products.
  *
  * Latency one or two cycles, one product per cycle. The geometry's program leaves a third of its cycles free, and all cycles in
  * which it waits for the cosine unit or the corner colours. So colours cannot starve.
  */
final class ShaderMultiplier(formats: ShaderFormats, hasCornerColours: Boolean, latency: Int = 1) extends Module {
  val io = IO(new ShaderMultiplierIO(formats, hasCornerColours))

  private val colour   = io.corners.map(corners => Mux(io.colour.valid, io.colour.bits, corners.bits))
  private val operands = Mux(io.geometry.valid, io.geometry.bits, colour.getOrElse(io.colour.bits))

  io.colour.ready := !io.geometry.valid
  io.corners.foreach(_.ready := !io.geometry.valid && !io.colour.valid)
  private val multiplied = ShiftRegister(operands, latency - 1)
  io.product := RegNext(multiplied.wide * multiplied.narrow)
}

object ShaderMultiplier {

  /** Cycles from operands to the product. An extra slice registers the operands; corner colours do not wait for it. */
  def latency(config: PathConfig): Int =
    if (config.device.geometry.cornerColours) 1 else 1 + TimingSlice.extra(config.device).cycles
}
