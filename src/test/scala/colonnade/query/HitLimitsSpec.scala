package colonnade.query

import chiseltest._
import colonnade.Simulation
import colonnade.TestParts._
import colonnade.numbers.FixedPorts._
import colonnade.unit.HitLimits
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** A result is a hit by the limits of its own context's ray. */
class HitLimitsSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "HitLimits"

  private case class Limits(tMin: BigInt, cullsFront: Boolean, cullsBack: Boolean, refusesClear: Boolean)

  it should "take hits from tMin on, of the sides and the kinds that each context's ray has" in
    test(new HitLimits(RayConfigs.tiny)).withAnnotations(Simulation.verilator) { dut =>
      val random   = new Random(1)
      val contexts = RayConfigs.tiny.array.contexts
      val most     = (BigInt(1) << RayConfigs.tiny.numbers.gridFraction) - 1
      val known    = Array.fill(contexts)(Option.empty[Limits])
      val counts   = Array.fill(2)(0)

      for (cycle <- 0 until 3000) {
        val begun = Option.when(cycle < contexts || random.nextInt(3) == 0) {
          def flag() = random.nextInt(4) == 0
          val tMin   = Seq(BigInt(0), most, BigInt(most.bitLength, random))(random.nextInt(3))
          (if (cycle < contexts) cycle else random.nextInt(contexts), Limits(tMin, flag(), flag(), flag()))
        }
        dut.io.rays.valid.poke(begun.nonEmpty)
        for ((context, limits) <- begun) {
          val ray = dut.io.rays.bits
          ray.context.poke(context)
          ray.limits.get.tMin.poke(limits.tMin)
          ray.limits.get.filter.cullsFront.poke(limits.cullsFront)
          ray.limits.get.filter.cullsBack.poke(limits.cullsBack)
          ray.limits.get.filter.refusesClear.poke(limits.refusesClear)
        }
        val context                     = random.nextInt(contexts)
        val Seq(isHit, backSide, clear) = Seq.fill(3)(random.nextInt(4) > 0)
        for (limits <- known(context)) {
          val t = (limits.tMin + Seq(-1, 0, 1, random.nextInt(1000))(random.nextInt(4))).max(0)
          dut.io.result.context.poke(context)
          dut.io.result.isHit.poke(isHit)
          dut.io.result.isTransmissive.poke(clear)
          dut.io.result.hit.backSide.poke(backSide)
          dut.io.result.hit.t.pokeRaw(t)
          val isCulled = if (backSide) limits.cullsBack else limits.cullsFront
          val expected = isHit && t >= limits.tMin && !isCulled && !(limits.refusesClear && clear)
          withClue(s"context $context, $limits, t $t, back side $backSide, clear $clear: ") {
            dut.io.isHit.peekBoolean() shouldBe expected
          }
          counts(if (expected) 1 else 0) += 1
        }
        begun.foreach { case (context, limits) => known(context) = Some(limits) }
        dut.clock.step()
      }
      counts.min should be > 500
    }
}
