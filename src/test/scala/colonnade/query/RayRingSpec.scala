package colonnade.query

import chiseltest._
import colonnade.Simulation
import colonnade.config.{PathConfig, QueriesConfig}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Rays that end in any order are offered in theirs, each with its run and after its context was read. */
class RayRingSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "RayRing"

  private val tiny = RayConfigs.tiny

  for (contexts <- Seq(64, 128))
    it should s"offer rays in their order, with $contexts contexts" in
      test(new RayRing(PathConfig(tiny.copy(queries = Some(QueriesConfig(contexts))))))
        .withAnnotations(Simulation.verilator) { dut =>
          val patient = new RingBench(dut, contexts, new Random(1), readiness = 0.5)
          patient.run(60)
          patient.maxInFlight shouldBe contexts
          val eager  = new RingBench(dut, contexts, new Random(2), readiness = 1)
          val cycles = eager.run(60)
          info(f"${eager.rays / cycles.toDouble}%.2f rays a cycle, of ${eager.maxInFlight} in flight at most")
        }
}

/** Hands over runs of any length, and ends their rays by both ports. */
private class RingBench(dut: RayRing, contexts: Int, random: Random, readiness: Double) extends Matchers {
  private case class Ray(run: Int, index: Int, context: Int)

  private val counts   = mutable.ArrayBuffer[Int]()
  private val failed   = mutable.Set[Int]()         // runs
  private val issued   = mutable.Queue[Ray]()       // not taken, the oldest one first
  private val traced   = mutable.ArrayBuffer[Ray]() // not resolved
  private val resolved = mutable.Set[Int]()         // contexts, as the unit knows of them
  private var issuing  = (0, 0)                     // run and index of the ray that comes next
  private var read     = Option.empty[Int]          // the context whose tables were read in the last cycle
  var maxInFlight: Int = 0
  var rays: Int        = 0

  /** @return cycles */
  def run(runs: Int): Int = {
    var cycles = 0
    var taken  = 0
    while (taken < runs) {
      cycles += 1
      cycles should be < 400 * runs
      val hasRun = counts.size < runs && random.nextInt(8) > 0
      val count  = if (random.nextBoolean()) Run.rays else 1 + random.nextInt(Run.rays)
      dut.io.runs.valid.poke(hasRun)
      dut.io.runs.bits.hits.poke(counts.size)
      dut.io.runs.bits.count.poke(count)
      val accepts = hasRun && dut.io.runs.ready.peekBoolean()

      // A ray has the context that is offered
      val (run, index) = issuing
      val hasContext   = dut.io.next.valid.peekBoolean()
      val issues       = run < counts.size && hasContext && random.nextDouble() < 0.8
      val isLast       = issues && index + 1 == counts(run)
      val fails        = issues && random.nextInt(200) == 0
      dut.io.issued.valid.poke(issues)
      dut.io.issued.bits.isLast.poke(isLast)
      dut.io.issued.bits.hasFailed.poke(fails)

      // Any two rays end
      val ends = dut.io.ends.map { port =>
        val ray = Option.when(traced.nonEmpty && random.nextDouble() < 0.5)(traced.remove(random.nextInt(traced.size)))
        port.valid.poke(ray.nonEmpty)
        ray.foreach(each => port.bits.poke(each.context))
        ray
      }

      // The oldest one is taken
      dut.io.rays.ready.poke(random.nextDouble() < readiness)
      if (dut.io.rays.valid.peekBoolean()) {
        val oldest = issued.head
        read shouldBe Some(oldest.context)
        resolved should contain(oldest.context)
        val offered = dut.io.rays.bits
        offered.run.hits.peekInt() shouldBe oldest.run
        offered.run.count.peekInt() shouldBe counts(oldest.run)
        offered.index.peekInt() shouldBe oldest.index
        offered.isFirst.peekBoolean() shouldBe oldest.index == 0
        offered.isLast.peekBoolean() shouldBe oldest.index + 1 == counts(oldest.run)
        offered.drops.peekBoolean() shouldBe failed(oldest.run)
        if (dut.io.rays.ready.peekBoolean()) {
          issued.dequeue()
          resolved -= oldest.context
          rays += 1
          if (oldest.index + 1 == counts(oldest.run)) taken += 1
        }
      }
      read = Option.when(dut.io.read.valid.peekBoolean())(dut.io.read.bits.peekInt().toInt)

      if (issues) {
        val ray = Ray(run, index, dut.io.next.bits.peekInt().toInt)
        issued.map(_.context) should not contain ray.context
        issued += ray
        traced += ray
        if (fails) failed += run
        issuing = if (isLast) (run + 1, 0) else (run, index + 1)
        maxInFlight = maxInFlight.max(issued.size)
      }
      if (accepts) counts += count
      resolved ++= ends.flatten.map(_.context)
      dut.clock.step()
    }
    issued shouldBe empty
    cycles
  }
}
