package colonnade.shading

import chiseltest._
import colonnade.{Simulation, TestConfigs}
import colonnade.config.NumberFormats
import colonnade.formats.Lobe
import colonnade.TestParts._
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Rough metal shows lights as [[GatherReference]] says: the distribution of Trowbridge and Reitz. */
class LobeStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LobeStage"

  for ((mac, div) <- Seq((16, 16), (32, 64))) {
    val numbers = TestConfigs.withPrecision(mac, mac, div).numbers

    it should s"find a share every three cycles with ${numbers.cosineFraction} bits" in
      test(new LobeStage(numbers, 4)).withAnnotations(Simulation.verilator) { dut =>
        val random = new Random(div)
        val one    = 1 << numbers.cosineFraction
        val slopes = 1 << Lobe.slopeBits
        val cases  = Seq.fill(300) {
          val cosine = if (random.nextBoolean()) random.nextInt(one + 1) else one - random.nextInt(one / 16)
          val slope  = random.nextInt(if (random.nextBoolean()) 1 << 13 else slopes)
          (cosine, slope, random.nextInt(if (random.nextBoolean()) 1100 else 2048))
        } ++ Seq((one, slopes - 1, 2047), (one, 0, 0), (0, slopes - 1, 0), (0, slopes - 1, 2047))
        dut.clock.setTimeout(0)
        def during(cycle: Int, first: Int)(use: ((Int, Int, Int), Int) => Unit): Unit = {
          val (operation, offset) = ((cycle - first) / 3, (cycle - first) % 3)
          if (cycle >= first && operation < cases.size) use(cases(operation), offset)
        }
        for (cycle <- 0 until 3 * cases.size + LobeStage.latency + 3) {
          dut.io.phase.poke((cycle + 4) % 3)
          during(cycle, 0)((now, _) => dut.io.cosine.poke(now._1))
          during(cycle, 1)((now, _) => dut.io.slope.poke(now._2))
          during(cycle, 8)((now, offset) => dut.io.peak.poke(if (offset == 0) now._3 else random.nextInt(2048)))
          during(cycle, LobeStage.latency) { (now, _) =>
            val (cosine, slope, peak) = now
            dut.io.share.expect(GatherReference.share(cosine, slope, peak, numbers.cosineFraction), s"$now")
          }
          dut.clock.step()
        }
      }
  }

  "Shares" should "be (alpha / (1 - x + alpha² (1 + x)))² within 2 %, where they are less than 64" in
    (for (alpha <- 4 to 192 by 4; x <- 0 to 65536 by 97) {
      val a        = alpha / 256.0
      val slope    = math.rint(64 * (1 - a * a) / (2 * a * a)).toInt
      val peak     = math.rint(-256 * math.log(a) / math.log(2)).toInt
      val cosine   = x / 65536.0
      val expected = math.pow(a / (1 - cosine + a * a * (1 + cosine)), 2).min(64)
      val found    = GatherReference.share(x, slope, peak, 16).toDouble / 65536
      assert(math.abs(found - expected) <= 0.02 * expected + 1.0 / 65536, s"$alpha at $cosine")
    })
}

/** The axis is the normal, or at rough metal the reflection of [[GatherReference]]. */
class LobeAxisStageSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LobeAxisStage"

  for (mac <- Seq(16, 32))
    it should s"find an axis every three cycles with $mac bits" in
      test(new LobeAxisStage(TestConfigs.gathering(TestConfigs.withPrecision(mac, mac, 2 * mac)))) { dut =>
        val shadeBits = NumberFormats.colourBits.+(6).min(mac)
        val random    = new Random(mac)
        val cases     = Seq.fill(600) {
          val normal = random.nextInt(20) match {
            case 0 => Seq(0, 0, 0)
            case 1 => Seq(-(1 << shadeBits), 0, 1)
            case _ => vector(random, shadeBits, random.nextDouble())
          }
          (normal, vector(random, shadeBits, 1), random.nextInt(3) > 0)
        }
        dut.clock.setTimeout(0)
        def during(cycle: Int, first: Int)(use: ((Seq[Int], Seq[Int], Boolean), Int) => Unit): Unit = {
          val (operation, axis) = ((cycle - first) / 3, (cycle - first) % 3)
          if (cycle >= first && operation < cases.size) use(cases(operation), axis)
        }
        for (cycle <- 0 until 3 * cases.size + LobeAxisStage.axis0 + 3) {
          dut.io.phase.poke(cycle % 3)
          during(cycle, 0)((now, axis) => dut.io.isRough.poke(if (axis == 0) now._3 else random.nextBoolean()))
          during(cycle, 1)((now, axis) => dut.io.dir.poke(now._2(axis)))
          during(cycle, 7)((now, axis) => dut.io.normal.poke(now._1(axis)))
          during(cycle, LobeAxisStage.axis0) { (now, axis) =>
            val (normal, dir, isRough) = now
            val expected               = if (isRough) GatherReference.lobeAxis(normal, dir, shadeBits) else normal
            dut.io.axis.expect(expected(axis), s"$now")
          }
          dut.clock.step()
        }
      }

  /** A vector whose largest component has all bits, the more of them the higher `share`; 1 is a ray's direction. */
  private def vector(random: Random, bits: Int, share: Double): Seq[Int] = {
    val drawn = Seq.fill(3)(random.nextDouble() * 2 - 1)
    val major = drawn.map(math.abs).zipWithIndex.max._2
    val most  = (1 << (bits - 1)) * (if (share == 1) 1.0 else 1 + share)
    drawn.zipWithIndex.map { case (x, axis) =>
      if (axis == major) (if (x < 0) -most else most).toInt else (x / math.abs(drawn(major)) * (most - 1)).toInt
    }
  }
}
