package colonnade.shading

import chisel3._
import chisel3.util.Cat
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.config.{GeometryConfig, NumberFormats}
import colonnade.formats.Vec3
import colonnade.numbers.{Normalise, Rounding, UnitLength}

final class GeometricNormalStageIO(geometry: GeometryConfig) extends Bundle {
  val phase    = Input(ModuloSchedule.phase())
  val vertices = Input(Vec(3, Vec3(UInt(geometry.vertexBits.W)))) // in cycles 0 to 2

  /** A component at a time, x first, from cycle `normal0` on. */
  val normal = Output(SInt(NumberFormats.normalBits.W))
}

/** The normal of a triangle by its winding, with the length of a stored normal: the exact cross product of two edges,
  * floored to a sign and `scaledBits` bits. A triangle every three cycles, by four multipliers.
  */
final class GeometricNormalStage(geometry: GeometryConfig) extends Module {
  import GeometricNormalStage._

  val io = IO(new GeometricNormalStageIO(geometry))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  // The cross product of the edges at vertex 0
  private val vertices = arriving(io.vertices, 0, interval - 1).at(0)
  private val edges    = latch(0)(VecInit(vertices.tail.map(to => difference(to, vertices.head))))
  private val first    = edges.at(xyz(1)).head.axes
  private val second   = edges.at(xyz(1)).last.axes
  private val left     = latch(xyz(1)) {
    select(xyz(1))(axis => first((axis + 1) % 3)) * select(xyz(1))(axis => second((axis + 2) % 3))
  }
  private val right = latch(xyz(1)) {
    select(xyz(1))(axis => first((axis + 2) % 3)) * select(xyz(1))(axis => second((axis + 1) % 3))
  }
  private val cross     = latch(xyz(2))(left.at(xyz(2)) -& right.at(xyz(2)))
  private val component = cross.at(xyz(3))

  // Scaled together, until the longest component has all bits
  private val lengths = accumulate(xyz(3), Mux(component < 0.S, ~component, component).asUInt(crossBits - 2, 0))(_ | _)
  // A set bit below the last one, for components of 0 and -1 alone
  private val zeros  = latch(6)(Normalise.countLeadingZeros(Cat(lengths.at(6), true.B))._2)
  private val moved  = delay(cross, xyz(3), 4).at(xyz(7)) << zeros.at(xyz(7))
  private val scaled = latch(xyz(7))(moved.asUInt(crossBits - 1, 0).head(scaledBits + 1).asSInt)

  // Scaled to the length of a stored normal
  private val square  = latch(xyz(8))((scaled.at(xyz(8)) * scaled.at(xyz(8))).asUInt)
  private val squared = accumulate(xyz(9), square.at(xyz(9)).pad(2 * octave))(_ + _)
  private val factor  = latch(12) {
    val length  = squared.at(12)
    val isShort = length(2 * octave - 1, 2 * octave - 2) === 0.U
    val aligned = Mux(isShort, Cat(length(2 * octave - 3, 0), 0.U(2.W)), length)
    val factor  = UnitLength.factor(aligned, octave, NumberFormats.unitNormal)
    Mux(isShort, Cat(factor, false.B), factor)
  }
  private val product = latch(xyz(13))(delay(scaled, xyz(8), 5).at(xyz(13)) * factor.at(xyz(13)).zext)
  private val normal  = latch(xyz(14)) {
    Rounding.narrow(Rounding.nearestEven(product.at(xyz(14)), octave - 2), NumberFormats.normalBits)
  }
  io.normal := normal.at(xyz(normal0))

  private def difference(to: Vec3[UInt], from: Vec3[UInt]): Vec3[SInt] =
    Vec3.of(to.axes.zip(from.axes).map { case (a, b) => (a -& b).asSInt })

  private def crossBits = 2 * geometry.vertexBits + 3
}

object GeometricNormalStage {

  /** Magnitude bits of a scaled component. */
  private val scaledBits = 12

  /** The length of three such components is below 2^octave. */
  private val octave = scaledBits + 1

  /** First cycle of the normal. */
  val normal0: Int = 15
}
