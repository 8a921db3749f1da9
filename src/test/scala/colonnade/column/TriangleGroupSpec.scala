package colonnade.column

import chiseltest._
import colonnade.traversal.{ExpectedHit, TestCandidate, TriangleHarness, TriangleStimulus}
import colonnade.{Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** [[TriangleGroup]]: every row gets the results of its own records, whatever the others do. */
class TriangleGroupSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "TriangleGroup"

  for ((rows, of, lanes, stalls) <- Seq((3, 3, 2, 3), (2, 3, 1, 3), (1, 3, 1, 0), (1, 1, 2, 3)))
    it should s"return each result to its row, with $rows of $of rows on $lanes units, stalls $stalls" in {
      val tiny   = TestConfigs.tiny
      val config = tiny.copy(
        array = tiny.array.copy(contexts = 3),
        units = tiny.units.copy(triangleLanes = lanes, triangleRows = of)
      )
      val stimulus = new TriangleStimulus(config, seed = 5)
      val harness  = new TriangleHarness(config, stimulus)
      val random   = new Random(7)
      test(new TriangleGroup(config, rows)).withAnnotations(Simulation.verilator) { shared =>
        shared.clock.setTimeout(0)

        // By row: records that wait, and by context the results that are still to come
        val waiting        = Seq.fill(rows)(mutable.Queue.from(harness.random(60)))
        val awaited        = Seq.fill(rows)(mutable.Map.empty[Int, mutable.Queue[(Boolean, ExpectedHit)]])
        val mayOpen        = Array.fill(rows)(false)
        var (cycles, hits) = (0, 0)
        var busiest        = 0
        while (waiting.exists(_.nonEmpty) || awaited.exists(_.nonEmpty)) {
          cycles should be < 6000
          for (row <- 0 until rows) {
            val port = shared.io.rows(row)

            // A record of an idle context, in the cycle after the row may grant one
            def next: Option[TestCandidate] = waiting(row).headOption.filterNot(c => awaited(row).contains(c.context))
            val sends                       = next.filter(_ => mayOpen(row))
            for (candidate <- sends) {
              port.candidate.ready.expect(true)
              harness.poke(port.candidate.bits, candidate)
              awaited(row)(candidate.context) =
                mutable.Queue.from(harness.expected(Seq(candidate)).map(r => (r.isLast, r.hit)))
              waiting(row).dequeue()
            }
            port.candidate.valid.poke(sends.nonEmpty)
            shared.io.waits(row).poke(next.nonEmpty)

            val accepts = stalls == 0 || random.nextInt(stalls) == 0
            port.result.ready.poke(accepts)
            if (accepts && port.result.valid.peekBoolean()) {
              val context       = port.result.bits.context.peekInt().toInt
              val (isLast, hit) = awaited(row)(context).dequeue()
              port.result.bits.isLast.expect(isLast)
              port.result.bits.isHit.expect(hit.isHit)
              if (hit.isHit) harness.peek(port.result.bits.hit.t) shouldBe hit.t
              if (hit.isHit) hits += 1
              if (isLast) awaited(row).remove(context)
            }
          }
          busiest = busiest.max(shared.io.rows.head.busy.peekInt().toInt)
          for (row <- 0 until rows) mayOpen(row) = shared.io.rows(row).readyNext.peekBoolean()
          shared.clock.step()
          cycles += 1
        }
        hits should be > 20 * rows
        busiest shouldBe lanes
      }
    }
}
