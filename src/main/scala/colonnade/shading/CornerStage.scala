package colonnade.shading

import chisel3._
import chisel3.util.{Cat, ShiftRegister}
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{FrameRegisters, Octahedral, Rgb, Vec3}
import colonnade.numbers.{DigitRecurrence, Rounding, UnitLength}

final class CornerStageIO(config: PathConfig) extends Bundle {
  val phase = Input(ModuloSchedule.phase())

  /** In cycles 0 to 2: the weights of a hit, and the colours of its corners. */
  val weights = Input(Vec(3, UInt(config.numbers.barycentricBits.W)))
  val colours = Input(Vec(3, Rgb(FrameRegisters.colour)))

  val colour = Output(Rgb(FrameRegisters.colour)) // in cycle 8
}

/** Interpolates the colours at the corners of a face, as [[CornerColours]] does: a hit every three cycles, by three
  * multipliers, and for each channel a restoring divider that finds four bits a cycle.
  */
final class CornerStage(config: PathConfig) extends Module {
  private val colourBits = NumberFormats.colourBits
  private val totalBits  = config.numbers.barycentricBits + 2
  private val perCycle   = colourBits / interval

  val io = IO(new CornerStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private val weights  = arriving(io.weights, 0, interval - 1)
  private val colours  = arriving(io.colours, 0, interval - 1)
  private val total    = latch(0)(weights.at(0).reduce(_ +& _).pad(totalBits))
  private val products = latch(xyz(0)) {
    val corners = weights.at(xyz(0)).zip(colours.at(xyz(0)))
    VecInit(corners.map { case (weight, colour) => weight * select(xyz(0))(colour.channels(_)) })
  }

  // Half of the divisor rounds the quotient
  private val sum = latch(xyz(1)) {
    (products.at(xyz(1)).reduce(_ +& _) +& (total.at(xyz(1)) >> 1))(totalBits + colourBits - 1, 0)
  }

  /** What is left of the division, above the bits found so far; and the divisor. */
  private def step(left: UInt, divisor: UInt): UInt = {
    val (fits, rest) = DigitRecurrence.step(left.head(totalBits + 1), divisor, totalBits)
    Cat(rest, left(colourBits - 2, 0), fits)
  }
  for ((channel, index) <- io.colour.channels.zipWithIndex) {
    val isStart = isAt(2 + index)
    val left    = Reg(UInt((totalBits + colourBits).W))
    val divisor = Reg(UInt(totalBits.W))
    val after   = (0 until perCycle).foldLeft(left)((left, _) => step(left, divisor))
    left    := Mux(isStart, sum.items(index).at(2 + index), after)
    when(isStart)(divisor := carry(total, 2 + index).at(2 + index))
    channel := latch(2 + index + interval)(after(colourBits - 1, 0)).at(8)
  }
}

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
