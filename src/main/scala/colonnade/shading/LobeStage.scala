package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat, Mux1H}
import colonnade.common.ModuloSchedule
import colonnade.common.ModuloSchedule.xyz
import colonnade.config.{NumberFormats, PathConfig}
import colonnade.formats.Lobe
import colonnade.numbers.{Normalise, Rounding}

/** Ports of [[LobeStage]]; cycles count from the cosine's. */
final class LobeStageIO(numbers: NumberFormats) extends Bundle {
  val phase  = Input(ModuloSchedule.phase())
  val cosine = Input(UInt((numbers.cosineFraction + 1).W))               // in cycles 0 to 2
  val slope  = Input(UInt(Lobe.slopeBits.W))                             // in cycles 1 to 3
  val peak   = Input(UInt(Lobe.peakBits.W))                              // in cycle 8
  val share  = Output(UInt((numbers.cosineFraction + Lobe.wholeBits).W)) // from cycle `latency` on, for three cycles
}

/** How brightly rough metal shows a light, by the cosine between the light and the axis of its lobe: docs/gather.md.
  * One every three cycles, by a multiplier, digit by digit, and tables of logarithms and powers.
  *
  * @param first cycle of the cosine in the schedule
  */
final class LobeStage(numbers: NumberFormats, first: Int) extends Module {
  import Lobe.{octaveLog, slopeFraction, wholeBits}

  private val fraction = numbers.cosineFraction

  val io = IO(new LobeStageIO(numbers))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  // 1 + slope · (1 - cosine)
  private val one     = (BigInt(1) << fraction).U((fraction + 1).W)
  private val rest    = latch(first)(one - arriving(io.cosine, first, first + 2).at(first))
  private val product =
    multiply(
      arriving(rest.at(first + 1).zext, first + 1, first + 3),
      arriving(io.slope.zext, first + 1, first + 3),
      first + 1
    )
  private val lengthBits = fraction + Lobe.slopeBits + 1
  private val octaveBits = log2Ceil(lengthBits - fraction - slopeFraction)
  private val length     = latch(first + 5) {
    (product.at(first + 5).asUInt +& (BigInt(1) << (fraction + slopeFraction)).U)(lengthBits - 1, 0)
  }

  // Its logarithm: octaves, and the bits below the leading one
  private val zeros    = Normalise.countLeadingZeros(length.at(first + 6))._2
  private val octaves  = latch(first + 6)((lengthBits - 1 - fraction - slopeFraction).U - zeros)
  private val mantissa = latch(first + 6) {
    (length.at(first + 6) << zeros)(lengthBits - 2, lengthBits - 1 - octaveLog)
  }
  private val logarithm = latch(first + 7) {
    Cat(
      octaves.at(first + 7)(octaveBits - 1, 0),
      0.U(octaveLog.W)
    ) +& VecInit(Lobe.logarithms.map(_.U))(mantissa.at(first + 7))
  }

  // peak / length²
  private val power = latch(first + 8) {
    io.peak.zext -& (2 << octaveLog).S -& Cat(logarithm.at(first + 8), 0.U(1.W)).zext
  }
  private val exponent = latch(first + 9)(power.at(first + 9) >> octaveLog)
  private val digits   = latch(first + 9) {
    VecInit(Lobe.powers.map(_.U((Lobe.powerBits + 1).W)))(power.at(first + 9).asUInt(octaveLog - 1, 0))
  }
  private val share = latch(first + 10) {
    val bits   = fraction + wholeBits
    val down   = (wholeBits - 1).S -& exponent.at(first + 10)
    val amount = Mux(down > bits.S, bits.U, down.asUInt)
    val raised = (digits.at(first + 10) << (bits - 1 - Lobe.powerBits)).asUInt
    Mux(down < 0.S, ((BigInt(1) << bits) - 1).U, raised >> amount(Normalise.exponentBits(bits) - 1, 0))
  }
  io.share := share.at(first + LobeStage.latency)
}

object LobeStage {
  val latency: Int = 11
}

/** Ports of [[LobeAxisStage]]. Vectors come and go a component at a time, x first. */
final class LobeAxisStageIO(config: PathConfig) extends Bundle {
  private val formats = new ShaderFormats(config.numbers)

  val phase   = Input(ModuloSchedule.phase())
  val isRough = Input(Bool()) // in cycle 0: the surface is rough metal with a lobe

  val dir    = Input(SInt((formats.shadeBits + 1).W)) // from cycle 1 on, as in [[SurfaceStage]]
  val normal = Input(SInt(formats.narrowBits.W))      // from cycle 7 on, likewise

  val axis = Output(SInt(formats.narrowBits.W)) // from cycle `axis0` on
}

/** The axis about which a surface is lit: its normal, or at rough metal the direction in which a smooth mirror would
  * reflect the ray, scaled like a normal: docs/gather.md. One every three cycles, by four multipliers.
  */
final class LobeAxisStage(config: PathConfig) extends Module {
  import LobeAxisStage._

  private val formats    = new ShaderFormats(config.numbers)
  private val dropped    = formats.shadeBits - operandBits
  private val squareBits = 2 * operandBits + 2 // of a squared length
  private val sumBits    = 2 * operandBits     // of a component of the reflection

  val io = IO(new LobeAxisStageIO(config))

  private val schedule = new ModuloSchedule(io.phase)
  import schedule._

  private val isRough = carry(latch(0)(io.isRough), 15)

  // Lengths and angle
  private val dir       = delay(arriving(Rounding.floor(io.dir, dropped), xyz(1)), xyz(1), 6)
  private val normal    = arriving(io.normal, xyz(7))
  private val narrow    = Rounding.floor(normal.at(xyz(7)), dropped)
  private val squareOf  = latch(xyz(7))(narrow * narrow)
  private val angleOf   = latch(xyz(7))(narrow * dir.at(xyz(7)))
  private val square    = accumulate(xyz(8), squareOf.at(xyz(8)).asUInt.pad(squareBits))(_ + _)
  private val angle     = accumulate(xyz(8), angleOf.at(xyz(8)).pad(squareBits + 1))(_ + _)
  private val against   = -angle.at(11)
  private val exponents = square.at(11)(squareBits - 1, squareBits - 3)
  private val isLonger  = Seq(exponents(2), exponents(2, 1) === 1.U, exponents === 1.U, exponents === 0.U)

  private def scaled(length: UInt): UInt =
    Mux1H(isLonger, Seq(3, 2, 1, 0).map(extra => Rounding.floor(length, operandBits - 1 + extra)))
  private val length = latch(11)(scaled(square.at(11))(operandBits - 1, 0))
  private val cosine = latch(11)(scaled(Mux(against > 0.S, against.asUInt, 0.U)(squareBits - 1, 0))(operandBits, 0))

  // The reflection, or the normal in the same scale
  private val dirAgain    = delay(dir, xyz(7), 5)
  private val normalAgain = delay(normal, xyz(7), 5)
  private val ofRay       = latch(xyz(12))(length.at(xyz(12)).zext * dirAgain.at(xyz(12)))
  private val ofNormal    =
    latch(xyz(12))(Cat(cosine.at(xyz(12)), 0.U(1.W)).zext * Rounding.floor(normalAgain.at(xyz(12)), dropped))
  private val sum = latch(xyz(13)) {
    val reflection = Rounding.narrow(ofRay.at(xyz(13)) +& ofNormal.at(xyz(13)), sumBits + 1)
    val aligned    = (delay(normalAgain, xyz(12), 1).at(xyz(13)) << (sumBits - formats.shadeBits)).asSInt
    Mux(isRough.at(xyz(13)), reflection, aligned)
  }

  // Scaled until the largest component has all bits; a reflection lacks two at most
  private val longest = accumulate(xyz(14), magnitude(sum.at(xyz(14))))(_ | _).at(17)
  private val missing = Mux(longest(sumBits, sumBits - 1).orR, 0.U, Mux(longest(sumBits - 2), 1.U, 2.U(2.W)))
  private val shift   = Mux(isAt(17), missing, latch(17)(missing).at(Seq(18, 19)))
  private val moved   = (delay(sum, xyz(14), 3).at(xyz(17)) << shift).asUInt(sumBits, 0).asSInt
  private val axis    = latch(xyz(17))(Rounding.floor(moved, sumBits - formats.shadeBits))
  io.axis := axis.at(xyz(axis0))

  private def magnitude(x: SInt): UInt = Mux(x < 0.S, 0.S -& x, x).asUInt(sumBits, 0)
}

object LobeAxisStage {

  /** Magnitude bits of the normal and of the ray's direction. */
  private val operandBits = 12

  /** First cycle of the axis. */
  val axis0: Int = 18
}
