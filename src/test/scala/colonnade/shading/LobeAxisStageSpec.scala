package colonnade.shading

import chiseltest._
import colonnade.TestConfigs
import colonnade.TestParts._
import colonnade.config.NumberFormats
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

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
