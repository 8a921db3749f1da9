package colonnade.traversal

import chisel3._
import chiseltest._
import colonnade.TestConfigs
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** Every ray visits each triangle record once, in memory order, whatever the other rays do. */
class LinearScanSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "LinearScan"

  private def config(contexts: Int): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    geometry = TestConfigs.tiny.geometry.copy(bvh = false)
  )

  for (contexts <- Seq(1, 5); records <- Seq(1, 7))
    it should s"lead rays of $contexts contexts through $records records" in
      test(new LinearScan(config(contexts))) { dut =>
        for ((accepted, seed) <- Seq((1.0, 1), (0.3, 2)))
          new Walkers(dut, contexts, records, seed).run(rays = 40, accepted)
      }

  it should "give a step one cycle after a resumption, one per cycle" in
    test(new LinearScan(config(contexts = 1))) { dut =>
      dut.io.scene.recordCount.poke(6)
      dut.io.start.valid.poke(true)
      dut.clock.step()
      dut.io.start.valid.poke(false)
      dut.io.resume.valid.poke(true)
      dut.io.steps.ready.poke(true)
      for (visited <- 1 to 5) {
        dut.io.resume.ready.expect(true)
        dut.clock.step()
        dut.io.steps.valid.expect(true)
        dut.io.steps.bits.isDone.expect(false)
        dut.io.steps.bits.target.address.expect(visited)
      }
      dut.clock.step()
      dut.io.steps.bits.isDone.expect(true)
    }
}

/** Rays that test records with random latency: each context has at most one. */
private class Walkers(dut: LinearScan, contexts: Int, records: Int, seed: Int) {
  private val random = new Random(seed)

  /** By context: addresses that its ray has visited; `busy` until it requests the next one. */
  private val visited  = mutable.Map.empty[Int, Vector[Int]]
  private val busy     = mutable.Set.empty[Int]
  private val resuming = mutable.Queue.empty[Int]
  private var begun    = 0
  private var ended    = 0

  dut.io.scene.recordCount.poke(records)

  def run(rays: Int, accepted: Double): Unit = {
    var idle = 0
    while (ended < rays) {
      val starts = (0 until contexts).find(!visited.contains(_)).filter(_ => begun < rays && random.nextInt(3) == 0)
      dut.io.start.valid.poke(starts.nonEmpty)
      starts.foreach(dut.io.start.bits.poke(_))
      dut.io.resume.valid.poke(resuming.nonEmpty)
      resuming.headOption.foreach(dut.io.resume.bits.poke(_))
      val accepts = random.nextDouble() < accepted
      dut.io.steps.ready.poke(accepts)

      idle += 1
      assert(idle < 100, "nothing happens")
      if (accepts && dut.io.steps.valid.peekBoolean()) {
        check()
        idle = 0
      }
      if (resuming.nonEmpty && dut.io.resume.ready.peekBoolean()) resuming.dequeue()
      dut.clock.step()

      for (context <- starts) {
        visited(context) = Vector(0) // the unit that starts a ray visits its first record
        busy += context
        begun += 1
      }
      for (context <- busy.toSeq.sorted if random.nextInt(3) == 0) {
        busy -= context
        resuming += context
      }
    }
    dut.io.steps.valid.expect(false)
  }

  private def check(): Unit = {
    val step    = dut.io.steps.bits
    val context = step.context.peekInt().toInt
    assert(
      visited.contains(context) && !busy(context) && !resuming.contains(context),
      s"context $context has not requested a step"
    )
    if (step.isDone.peekBoolean()) {
      assert(visited(context) == (0 until records))
      visited -= context
      ended += 1
    } else {
      step.target.isLeaf.expect(true)
      visited(context) :+= step.target.address.peekInt().toInt
      assert(visited(context).size <= records, s"context $context does not end: ${visited(context)}")
      busy += context
    }
  }
}
