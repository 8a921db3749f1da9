package colonnade.shading

import chisel3._
import chisel3.util.Cat
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.{SamplePoint, Vec3}
import colonnade.numbers.{FoldedSquareRoot, Rounding}

/** Ports of [[ScatterStage]]. Vectors come and go a component at a time, x first. */
final class ScatterStageIO(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val phase = Input(ModuloSchedule.phase())
  val point = Input(new SamplePoint) // in cycle 0

  /** From cycle 1 and from cycle 7 on, and in cycle 16: as those of [[SurfaceStage]], and the normal's squared length. */
  val faceForwardNormal = Input(SInt((NumberFormats.normalBits + 1).W))
  val normal            = Input(SInt(formats.narrowBits.W))
  val squaredNormal     = Input(UInt(formats.dotBits.W))

  val dir = Output(ScatterStage.component) // from cycle `dir0` on
}

/** The direction of the ray that gathers light at a diffuse surface: n + |n| · s, with s a point of the unit sphere, which
  * makes its density the cosine to n: docs/gather.md. One every three cycles, by a square root and three multipliers: for
  * s, for |n| · s, and for the side of the surface.
  */
final class ScatterStage(config: PathConfig) extends Module {
  import ScatterStage._

  private val formats = new ShaderFormats(config.numbers)

  val io = IO(new ScatterStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  // The point of the sphere: z is linear in u, v is the angle about z
  private val early       = carry(latch(0)(io.point), 18)
  private val late        = carry(early, 21)
  private val quarter     = early.at(17).v(SamplePoint.bits - 1, SamplePoint.bits - 2)
  private val angle       = early.at(17).v(SamplePoint.bits - 3, 0)
  private val radius      = latch(17)(VecInit(radii.map(_.U(unitBits.W)))(early.at(17).u))
  private val isBackwards = quarter(0)
  private val cosine      = Seq(isBackwards, !isBackwards).map(isBackwards => Mux(isBackwards, ~angle, angle))
  private val across      = latch(Seq(17, 18))(VecInit(cosines.map(_.U(unitBits.W)))(select(Seq(17, 18))(cosine(_))))
  private val product     = latch(Seq(18, 19))(radius.at(Seq(18, 19)) * across.at(Seq(18, 19)))
  private val rounded     = ((product.at(Seq(19, 20)) +& (1 << (unit - 1)).U) >> unit)(unitBits - 1, 0).zext
  private val quarters    = late.at(19).v(SamplePoint.bits - 1, SamplePoint.bits - 2)
  private val isMinus     = Seq(quarters.xorR, quarters(1))
  private val ofSphere    = latch(Seq(19, 20, 21)) {
    val signed = Seq(0, 1).map(axis => Mux(isMinus(axis), -rounded, rounded).pad(unitBits + 1))
    val z      = (((1 << unit) - 1).S((unitBits + 2).W) - Cat(late.at(21).u, 0.U(1.W)).zext)(unitBits, 0).asSInt
    select(Seq(19, 20, 21))(axis => if (axis < 2) signed(axis) else z)
  }

  // The normal's length
  private val length = Module(new FoldedSquareRoot(2 * lengthBits, interval)).io
  length.isStep   := isAt(16)
  length.radicand := Rounding.floor(io.squaredNormal, formats.dotBits - 2 * lengthBits)
  private val root = arriving(length.root, rootCycle, rootCycle + interval - 1)

  // The direction
  private val normal = Rounding.floor(io.normal, formats.shadeBits - normalBits)
  private val scaled = latch(xyz(23))(root.at(xyz(23)).zext * delay(ofSphere, xyz(20), 3).at(xyz(23)))
  private val sum    = latch(xyz(24)) {
    scaled.at(xyz(24)) +& (delay(arriving(normal, xyz(7)), xyz(7), 17).at(xyz(24)) << normalShift).asSInt
  }
  private val dir = Rounding.narrow(Rounding.floor(sum.at(xyz(25)), dropped), componentBits)

  // It is negated if it points below the surface
  private val geometric = delay(
    arriving(Rounding.floor(io.faceForwardNormal, NumberFormats.normalBits - sideBits), xyz(1)),
    xyz(1),
    24
  ).at(xyz(25))
  private val sides   = latch(xyz(25))(Rounding.floor(dir, componentBits - sideBits - 2) * geometric)
  private val side    = accumulate(xyz(26), sides.at(xyz(26)).pad(2 * sideBits + 6))(_ + _)
  private val isBelow = latch(29)(side.at(29) < 0.S)
  private val last    = delay(arriving(dir, xyz(25)), xyz(25), 5).at(xyz(dir0))
  private val upwards = Mux(isBelow.at(xyz(dir0)), -last, last)
  io.dir := Mux(isAt(xyz(dir0).last), (upwards.asUInt | 1.U).asSInt, upwards)
}

object ScatterStage {
  private val unit     = SamplePoint.bits // fraction bits of a component of a point of the sphere
  private val unitBits = unit + 1         // of its magnitude

  /** Magnitude bits of the normal, and of its length in units of 2^(1 - normalShift). */
  private val normalBits  = 12
  private val lengthBits  = 12
  private val normalShift = 7
  private val rootCycle   = 17 + interval * FoldedSquareRoot.intervals(2 * lengthBits, interval)
  private val dropped     = 4 // low bits of the sum
  private val sideBits    = 8 // of the geometric normal, with its sign, for the side

  /** First cycle of the direction. */
  val dir0: Int = 30

  /** Width of a component of the direction, signed. */
  val componentBits: Int = 18

  def component: SInt = SInt(componentBits.W)

  def dir: Vec3[SInt] = Vec3(component)

  /** By u: the distance of the point from the axis z, with `unit` fraction bits. */
  val radii: Seq[Int] = Seq.tabulate(1 << SamplePoint.bits) { u =>
    val z = (255 - 2 * u) / 256.0
    math.rint(256 * math.sqrt(1 - z * z)).toInt
  }

  /** By the index of a quarter circle: the cosine in the middle of its interval. */
  val cosines: Seq[Int] = Seq.tabulate(1 << (SamplePoint.bits - 2)) { index =>
    math.rint(256 * math.cos((index + 0.5) * math.Pi / 128)).toInt
  }
}
