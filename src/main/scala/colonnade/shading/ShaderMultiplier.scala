package colonnade.shading

import chisel3._
import chisel3.util.{Decoupled, Valid}

final class ShaderMultiplierIO(formats: ShaderFormats) extends Bundle {

  /** Never waits. */
  val geometry = Flipped(Valid(new Factors(formats)))

  /** Takes the cycles that the geometry leaves. */
  val colour = Flipped(Decoupled(new Factors(formats)))

  /** Of the factors taken in the cycle before; whoever gave them takes it now. */
  val product = Output(SInt(formats.productBits.W))
}

/** The shader's only multiplier, exact.
  *
  * Latency one cycle, a product a cycle. The geometry's schedule leaves a third of its cycles free, and all cycles in
  * which it waits for the cosine: colours cannot starve.
  */
final class ShaderMultiplier(formats: ShaderFormats) extends Module {
  val io = IO(new ShaderMultiplierIO(formats))

  private val factors = Mux(io.geometry.valid, io.geometry.bits, io.colour.bits)

  io.colour.ready := !io.geometry.valid
  io.product      := RegNext(factors.wide * factors.narrow)
}
