package colonnade.shading

import chisel3._
import chisel3.util.ShiftRegister
import colonnade.config.NumberFormats
import colonnade.formats.{Octahedral, Vec3}
import colonnade.numbers.{Rounding, UnitLength}

final class OctahedralDecoderIO extends Bundle {
  val code   = Input(Octahedral.code)
  val normal = Output(Vec3(SInt(NumberFormats.normalBits.W))) // `latency` cycles later
}

/** Decodes a corner normal in each cycle: unfolds the octahedron, and scales its point to a stored normal's length. */
final class OctahedralDecoder extends Module {
  import OctahedralDecoder._

  val io = IO(new OctahedralDecoderIO)

  // Unfold; the complement of a magnitude is its distance from 1023
  private val codes      = Seq(io.code.u, io.code.v)
  private val magnitudes = codes.map(code => registered(magnitude(code)))
  private val up         = registered((~magnitudes.head).zext - magnitudes.last.zext)
  private val across     = magnitudes.zip(magnitudes.reverse).zip(codes).map { case ((length, other), code) =>
    val unfolded = Mux(up < 0.S, registered(~other), registered(length)).zext
    Mux(ShiftRegister(code < 0.S, 2), 0.S -% unfolded, unfolded)
  }
  private val point = (across :+ Rounding.narrow(up, Octahedral.bits)).map(registered(_))

  // Scale
  private val squares = point.map(c => registered((c * c).asUInt))
  private val squared = registered(Rounding.narrow(squares.reduce(_ +& _), 2 * magnitudeBits))
  private val factor  = registered(UnitLength.factor(squared, magnitudeBits, NumberFormats.unitNormal))
  for ((component, of) <- io.normal.axes.zip(point)) {
    val product = registered(ShiftRegister(of, 3) * factor.zext)
    component := registered(Rounding.narrow(Rounding.nearestEven(product, magnitudeBits - 2), NumberFormats.normalBits))
  }

  private def registered[T <: Data](x: T): T = {
    val register = Reg(chiselTypeOf(x))
    register := x
    register
  }

  /** At most all ones. */
  private def magnitude(x: SInt): UInt = {
    val length = Mux(x < 0.S, 0.S -% x, x).asUInt
    Mux(length(magnitudeBits), ~0.U(magnitudeBits.W), length(magnitudeBits - 1, 0))
  }
}

object OctahedralDecoder {
  val latency: Int = 8

  private val magnitudeBits = Octahedral.bits - 1
}
