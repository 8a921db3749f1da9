package colonnade.shading

import chisel3._
import chisel3.util.{Cat, Mux1H}
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.xyz
import colonnade.config.{ColonnadeConfig, NumberFormats}
import colonnade.numbers.{Normalise, Rounding}

/** Ports of [[SurfaceStage]]. Vectors come and go a component at a time, x first, in the object's frame. */
final class SurfaceStageIO(config: ColonnadeConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val phase  = Input(UInt(2.W))
  val offset = Input(UInt((config.numbers.gridBits - 2).W))

  /** In cycles 0 to 3. */
  val hit = Input(new ShadingHit(config))

  /** From cycle 2 on: the geometric normal, turned against the ray; the ray's direction. */
  val faceForwardNormal = Output(SInt((NumberFormats.normalBits + 1).W))
  val dir               = Output(SInt((formats.shadeBits + 1).W))

  /** From cycle 7 on: the hit point, moved off the surface; the shading normal, scaled to `shadeBits` bits. */
  val origin = Output(SInt(ShaderFormats.originBits(config).W))
  val normal = Output(SInt(formats.narrowBits.W))

  /** In cycles 6 to 9: the normal is the smooth one. */
  val isSmooth = Output(Bool())
}

/** The point and the shading normal of a hit: docs/numbers.md, 5.1 to 5.3 and 5.5. A hit every four cycles, by three
  * multipliers for the normal, one for both products of a slope and the distance, in two digits each, and one for the offset.
  * A smooth normal of zero gives way to the geometric one without a second start.
  */
final class SurfaceStage(config: ColonnadeConfig) extends Module {
  private val numbers = config.numbers
  private val formats = new ShaderFormats(numbers)

  val io = IO(new SurfaceStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private val hit = arriving(io.hit, 0, 3)

  /** The ray's axes that the object's axes are, in three cycles. */
  private def rayAxes(cycles: Seq[Int], axis: UInt): Seq[Bool] =
    Seq(2, 1, 0).map(turn => select(cycles)(component => axis === ((component + turn) % 3).U))

  // The geometric normal, and the longest of its components
  private val backSide          = latch(1)(hit.at(1).backSide)
  private val geometricNormal   = select(xyz(1))(hit.at(xyz(1)).geometricNormal.axes(_))
  private val negated           = -geometricNormal.pad(NumberFormats.normalBits + 1)
  private val faceForwardNormal =
    latch(xyz(1))(Mux(hit.at(xyz(1)).backSide, negated, geometricNormal.pad(NumberFormats.normalBits + 1)))
  private val flatLength = longest(xyz(1), geometricNormal.pad(NumberFormats.normalBits + 1), negated)

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
  private val registerSaysFlat = latch(3)(hit.at(3).isFlat)
  private val flat             = registerSaysFlat.at(5) || smoothLength.at(5) === 0.U
  private val isFlat           = latch(5)(flat)
  private val normalZeros      = latch(5) {
    val length = Mux(flat, flatLength.at(5).pad(formats.normalSumBits - 1), smoothLength.at(5))
    Normalise.countLeadingZeros(length)._2
  }
  private val normal = latch(xyz(6)) {
    val flatNormal = delay(faceForwardNormal, xyz(2), 4).at(xyz(6)).pad(formats.normalSumBits)
    val shading    = Mux(isFlat.at(xyz(6)), flatNormal, delay(smooth, xyz(3), 3).at(xyz(6)))
    val scaled     = (shading << normalZeros.at(xyz(6))).asUInt(formats.normalSumBits - 1, 0)
    scaled.head(formats.narrowBits).asSInt
  }

  // The offset, the ray's origin and the way along its dominant axis
  private val offsetProduct = latch(xyz(2))(io.offset.zext * faceForwardNormal.at(xyz(2)))
  private val offset = latch(xyz(3))(Rounding.nearestEven(offsetProduct.at(xyz(3)), NumberFormats.normalFraction))
  private val start  = latch(xyz(1)) {
    val now      = hit.at(xyz(1))
    val axes     = rayAxes(xyz(1), now.axis)
    val isNeg    = axes.last && now.isNegative
    val distance = Mux(axes.last, now.distance, 0.S).pad(now.origin.head.getWidth)
    val addend   = Mux(isNeg, ~distance, distance)
    added(Mux1H(axes, now.origin), addend, isNeg)
  }
  private val moved = latch(xyz(4))(delay(start, xyz(2), 2).at(xyz(4)) + offset.at(xyz(4)).pad(io.origin.getWidth))

  // The slopes times the distance, in two digits each, and the point
  private val lowBits = (numbers.gridBits + 1) / 2
  private val digit   = latch(0 to 3) {
    val now    = hit.at(0 to 3)
    val digits = now.shear.flatMap(slope => Seq(slope.asUInt(lowBits - 1, 0).zext, (slope >> lowBits).pad(lowBits + 1)))
    now.distance * select(0 to 3)(digits(_))
  }
  private val lowDigit = latch(Seq(1, 3))(digit.items(0, 2).at(Seq(1, 3)))
  private val slide    = latch(Seq(2, 4)) {
    (digit.items(1, 3).at(Seq(2, 4)) << lowBits).asSInt + lowDigit.at(Seq(2, 4))
  }
  private val rounded = Rounding.narrow(
    Rounding.nearestEven(slide.at(Seq(4, 5)), numbers.shearFraction),
    formats.pointBits
  )
  private val slides = Seq(latch(4)(rounded), latch(5)(rounded))
  private val axis   = latch(5)(latch(3)(hit.at(3).axis).at(5))
  private val origin = latch(xyz(6)) {
    val addend = Mux1H(rayAxes(xyz(6), axis.at(xyz(6))).init, slides.map(_.at(xyz(6)))).pad(io.origin.getWidth)
    added(delay(moved, xyz(5), 1).at(xyz(6)), addend, false.B)
  }

  // The direction, as long as 2^(shadeBits - 1) along the dominant axis
  private val dir = latch(xyz(1)) {
    val now    = hit.at(xyz(1))
    val one    = (BigInt(1) << (formats.shadeBits - 1)).S((formats.shadeBits + 1).W)
    val slopes = now.shear.map(slope =>
      Rounding.narrow(
        Rounding.floor(slope, numbers.shearFraction - (formats.shadeBits - 1)),
        formats.shadeBits + 1
      ).pad(formats.shadeBits + 1)
    )
    Mux1H(rayAxes(xyz(1), now.axis), slopes :+ Mux(now.isNegative, -one, one))
  }

  io.faceForwardNormal := faceForwardNormal.at(xyz(2))
  io.dir               := dir.at(xyz(2))
  io.origin            := origin.at(xyz(7))
  io.normal            := normal.at(xyz(7))
  io.isSmooth          := !isFlat.at(6)

  /** The bitwise or of three magnitudes, which is as long as the largest of them; `negative` is the negated component. */
  private def longest(cycles: Seq[Int], component: SInt, negative: SInt) =
    accumulate(cycles, Mux(component < 0.S, negative, component).asUInt(component.getWidth - 2, 0))(_ | _)

  private def added(left: SInt, right: SInt, carry: Bool): SInt =
    (Cat(left.asUInt, true.B) + Cat(right.asUInt, carry))(left.getWidth, 1).asSInt
}
