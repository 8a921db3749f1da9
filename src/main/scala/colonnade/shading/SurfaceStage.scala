package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Mux1H}
import colonnade.common.ModuloSchedule.{interval, xyz}
import colonnade.common.{ModuloSchedule, Timed}
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.numbers.{Normalise, Rounding}

/** Ports of [[SurfaceStage]]. Vectors come and go a component at a time, x first, in the object's frame. */
final class SurfaceStageIO(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val phase  = Input(ModuloSchedule.phase())
  val offset = Input(UInt((config.numbers.gridBits - 2).W))
  val hit    = Input(new ShadingHit(config)) // in cycles 0 to 2

  /** From cycle 1 on: the geometric normal, turned against the ray; the ray's direction. */
  val faceForwardNormal = Output(SInt((NumberFormats.normalBits + 1).W))
  val dir               = Output(SInt((formats.shadeBits + 1).W))

  val origin = Output(SInt(ShaderFormats.originBits(config).W)) // from cycle 6 on: the point, off the surface
  val normal   = Output(SInt(formats.narrowBits.W)) // from cycle 7 on: the shading normal, scaled to `shadeBits` bits
  val isSmooth = Output(Bool())                     // in cycles 7 and 8: the normal is the smooth one
}

/** The point and the shading normal of a hit: docs/numbers.md, 5.1 to 5.3 and 5.5. A hit every three cycles, by three
  * multipliers for the normal, two for the products of the slopes and the distance, digit by digit, and one for the
  * offset. A smooth normal of zero gives way to the geometric one without a second start.
  */
final class SurfaceStage(config: PathConfig) extends Module {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val io = IO(new SurfaceStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private val hit = arriving(io.hit, 0, interval - 1)

  /** The ray's axes that the object's axes are, in three cycles. */
  private def rayAxes(cycles: Seq[Int], axis: UInt): Seq[Bool] =
    Seq(2, 1, 0).map(turn => select(cycles)(component => axis === ((component + turn) % 3).U))

  // The geometric normal, and the longest of its components
  private val backSide          = latch(1)(hit.at(1).backSide)
  private val geometricNormal   = select(xyz(0))(hit.at(xyz(0)).geometricNormal.axes(_))
  private val negated           = -geometricNormal.pad(NumberFormats.normalBits + 1)
  private val faceForwardNormal =
    latch(xyz(0))(Mux(hit.at(xyz(0)).backSide, negated, geometricNormal.pad(NumberFormats.normalBits + 1)))
  private val flatLength = longest(xyz(0), geometricNormal.pad(NumberFormats.normalBits + 1), negated)

  // The smooth normal
  private val weighted = latch(xyz(0)) {
    val now = hit.at(xyz(0))
    VecInit(now.weights.zip(now.normals).map { case (weight, normal) => weight.zext * select(xyz(0))(normal.axes(_)) })
  }
  private val sum          = latch(xyz(1))(Rounding.narrow(weighted.at(xyz(1)).reduce(_ +& _), formats.normalSumBits))
  private val turned       = -sum.at(xyz(2))
  private val smooth       = latch(xyz(2))(Mux(backSide.at(xyz(2)), turned, sum.at(xyz(2))))
  private val smoothLength = longest(xyz(2), sum.at(xyz(2)), turned)

  // The shading normal, scaled
  private val registerSaysFlat = latch(2)(hit.at(2).isFlat)
  private val flat             = registerSaysFlat.at(5) || smoothLength.at(5) === 0.U
  private val isFlat           = latch(5)(flat)
  private val normalZeros      = latch(5) {
    val length = Mux(flat, carry(flatLength, 5).at(5).pad(formats.normalSumBits - 1), smoothLength.at(5))
    Normalise.countLeadingZeros(length)._2
  }
  private val normal = latch(xyz(6)) {
    val flatNormal = delay(faceForwardNormal, xyz(1), 5).at(xyz(6)).pad(formats.normalSumBits)
    val shading    = Mux(isFlat.at(xyz(6)), flatNormal, delay(smooth, xyz(3), 3).at(xyz(6)))
    val scaled     = (shading << normalZeros.at(xyz(6))).asUInt(formats.normalSumBits - 1, 0)
    scaled.head(formats.narrowBits).asSInt
  }

  // The offset, the ray's origin and the way along its dominant axis
  private val offsetProduct = latch(xyz(1))(io.offset.zext * faceForwardNormal.at(xyz(1)))
  private val offset = latch(xyz(2))(Rounding.nearestEven(offsetProduct.at(xyz(2)), NumberFormats.normalFraction))
  private val start  = latch(xyz(0)) {
    val now      = hit.at(xyz(0))
    val axes     = rayAxes(xyz(0), now.axis)
    val isNeg    = axes.last && now.isNegative
    val distance = Mux(axes.last, now.distance, 0.S).pad(now.origin.head.getWidth)
    val addend   = Mux(isNeg, ~distance, distance)
    added(Mux1H(axes, now.origin), addend, isNeg)
  }
  private val moved = latch(xyz(3))(delay(start, xyz(1), 2).at(xyz(3)) + offset.at(xyz(3)).pad(io.origin.getWidth))

  // The slopes times the distance, and the point
  private def ofHit[T <: Data](field: ShadingHit => T): Timed[T] = arriving(field(io.hit), hit.first, hit.last)
  private val slides                                             = Seq.tabulate(2) { index =>
    val slide = multiply(ofHit(_.distance), ofHit(_.shear(index)), 0)
    latch(4)(Rounding.narrow(Rounding.nearestEven(slide.at(4), numbers.shearFraction), formats.pointBits))
  }
  private val axis   = latch(4)(latch(2)(hit.at(2).axis).at(4))
  private val origin = latch(xyz(5)) {
    val addend = Mux1H(rayAxes(xyz(5), axis.at(xyz(5))).init, slides.map(_.at(xyz(5)))).pad(io.origin.getWidth)
    added(delay(moved, xyz(4), 1).at(xyz(5)), addend, false.B)
  }

  // The direction, as long as 2^(shadeBits - 1) along the dominant axis
  private val dir = latch(xyz(0)) {
    val now    = hit.at(xyz(0))
    val one    = (BigInt(1) << (formats.shadeBits - 1)).S((formats.shadeBits + 1).W)
    val slopes = now.shear.map(slope =>
      Rounding.narrow(
        Rounding.floor(slope, numbers.shearFraction - (formats.shadeBits - 1)),
        formats.shadeBits + 1
      ).pad(formats.shadeBits + 1)
    )
    Mux1H(rayAxes(xyz(0), now.axis), slopes :+ Mux(now.isNegative, -one, one))
  }

  io.faceForwardNormal := faceForwardNormal.at(xyz(1))
  io.dir               := dir.at(xyz(1))
  io.origin            := origin.at(xyz(6))
  io.normal            := normal.at(xyz(7))
  io.isSmooth          := !isFlat.at(7)

  /** The bitwise or of three magnitudes, which is as long as the largest of them; `negative` is the negated component.
    */
  private def longest(cycles: Seq[Int], component: SInt, negative: SInt) =
    accumulate(cycles, Mux(component < 0.S, negative, component).asUInt(component.getWidth - 2, 0))(_ | _)

  private def added(left: SInt, right: SInt, carry: Bool): SInt =
    (Cat(left.asUInt, true.B) + Cat(right.asUInt, carry))(left.getWidth, 1).asSInt
}
