package colonnade.shading

import chisel3._
import chisel3.util.{log2Ceil, Cat}
import colonnade.common.ModuloSchedule
import colonnade.config.NumberFormats
import colonnade.formats.Lobe
import colonnade.numbers.Normalise

/** Ports of [[LobeStage]]; cycles count from the cosine's. */
final class LobeStageIO(numbers: NumberFormats) extends Bundle {
  val phase  = Input(ModuloSchedule.phase())
  val cosine = Input(UInt((numbers.cosineFraction + 1).W))               // in cycles 0 to 2
  val slope  = Input(UInt(Lobe.slopeBits.W))                             // in cycles 1 to 3
  val peak   = Input(UInt(Lobe.peakBits.W))                              // in cycle 8
  val share  = Output(UInt((numbers.cosineFraction + Lobe.wholeBits).W)) // from cycle `latency` on, for three cycles
}

/** How brightly rough metal shows a light, by the cosine between the light and the axis of its lobe: docs/gather.md. One
  * every three cycles, by a multiplier, digit by digit, and tables of logarithms and powers.
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
