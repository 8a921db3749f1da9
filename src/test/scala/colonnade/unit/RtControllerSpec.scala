package colonnade.unit

import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

/** A context is always at one place of its round, and goes on when something happens to it, and only then. */
class RtControllerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RtController"

  private def config(contexts: Int, base: ColonnadeConfig = TestConfigs.tiny): ColonnadeConfig =
    base.copy(array = base.array.copy(contexts = contexts))

  for (contexts <- Seq(1, 3, 16))
    it should s"follow $contexts contexts through random events" in
      test(new RtController(config(contexts))) { dut =>
        for ((eagerness, seed) <- Seq((0.9, 1), (0.15, 2)))
          new RtRounds(dut, contexts, seed).run(pixels = 70, eagerness)
      }

  for (contexts <- Seq(1, 3, 16))
    it should s"follow $contexts contexts through a room, and past one that is not there" in
      test(new RtController(config(contexts, TestConfigs.withRoom(TestConfigs.room)))) { dut =>
        val seen = for ((eagerness, isThere, seed) <- Seq((0.9, true, 3), (0.15, true, 4), (0.5, false, 5))) yield {
          val rounds = new RtRounds(dut, contexts, seed, isThere)
          rounds.run(pixels = 70, eagerness)
          rounds.seen
        }
        assert(seen.flatten.distinct.size == 4, "paths have met the room in every way")
        assert(seen.last.isEmpty)
      }

  it should "judge one ended ray and let one pixel leave a cycle" in
    test(new RtController(config(contexts = 4))) { dut =>
      val rounds = new RtRounds(dut, count = 4, seed = 1)
      for (_ <- 0 until 3) rounds.cycle(_.allocate = true)
      rounds.cycle(_.ended(1) = Some(0))
      rounds.cycle(_.leave = true)
      dut.io.freeCount.expect(1)
      rounds.cycle { events =>
        events.ended(0) = Some(1)
        events.ended(2) = Some(2)
      }
      for (_ <- 0 until 2) {
        dut.io.judged.valid.expect(true)
        rounds.cycle(_.leave = true)
      }
      dut.io.judged.valid.expect(false)
      rounds.cycle(_.leave = true)
      dut.io.freeCount.expect(3)
    }
}
