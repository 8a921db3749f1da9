package colonnade.traversal

import chisel3._
import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** Every ray visits each triangles record once, in the order of the memory, however the others walk. */
class ExhaustiveWalkSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "ExhaustiveWalk"

  private def config(contexts: Int): ColonnadeConfig = TestConfigs.tiny.copy(
    array = TestConfigs.tiny.array.copy(contexts = contexts),
    geometry = TestConfigs.tiny.geometry.copy(bvh = false)
  )

  for (contexts <- Seq(1, 5); (base, records) <- Seq((0, 1), (3, 7)))
    it should s"lead rays of $contexts contexts through $records records from $base" in
      test(new ExhaustiveWalk(config(contexts))) { dut =>
        for ((accepted, seed) <- Seq((1.0, 1), (0.3, 2)))
          new Walkers(dut, contexts, base, records, seed).run(rays = 40, accepted)
      }

  it should "answer a resumption in the next cycle, one a cycle" in
    test(new ExhaustiveWalk(config(contexts = 1))) { dut =>
      dut.io.scene.triangleBase.poke(10)
      dut.io.scene.triangleRecords.poke(6)
      dut.io.start.valid.poke(true)
      dut.clock.step()
      dut.io.start.valid.poke(false)
      dut.io.resume.valid.poke(true)
      dut.io.visits.ready.poke(true)
      for (visited <- 1 to 5) {
        dut.io.resume.ready.expect(true)
        dut.clock.step()
        dut.io.visits.valid.expect(true)
        dut.io.visits.bits.isDone.expect(false)
        dut.io.visits.bits.visit.address.expect(10 + visited)
      }
      dut.clock.step()
      dut.io.visits.bits.isDone.expect(true)
    }
}

/** Rays that test records for a while: each context has one or none. */
private class Walkers(dut: ExhaustiveWalk, contexts: Int, base: Int, records: Int, seed: Int) {
  private val random = new Random(seed)

  /** By context: addresses its ray has visited; `busy` when it has not yet asked for the next one. */
  private val visited  = mutable.Map.empty[Int, Vector[Int]]
  private val busy     = mutable.Set.empty[Int]
  private val resuming = mutable.Queue.empty[Int]
  private var begun    = 0
  private var ended    = 0

  dut.io.scene.triangleBase.poke(base)
  dut.io.scene.triangleRecords.poke(records)

  def run(rays: Int, accepted: Double): Unit = {
    var idle = 0
    while (ended < rays) {
      val starts = (0 until contexts).find(!visited.contains(_)).filter(_ => begun < rays && random.nextInt(3) == 0)
      dut.io.start.valid.poke(starts.nonEmpty)
      starts.foreach(dut.io.start.bits.poke(_))
      dut.io.resume.valid.poke(resuming.nonEmpty)
      resuming.headOption.foreach(dut.io.resume.bits.poke(_))
      val accepts = random.nextDouble() < accepted
      dut.io.visits.ready.poke(accepts)

      idle += 1
      assert(idle < 100, "nothing happens")
      if (accepts && dut.io.visits.valid.peekBoolean()) {
        check()
        idle = 0
      }
      if (resuming.nonEmpty && dut.io.resume.ready.peekBoolean()) resuming.dequeue()
      dut.clock.step()

      for (context <- starts) {
        visited(context) = Vector(base) // whoever starts a ray visits its first record
        busy += context
        begun += 1
      }
      for (context <- busy.toSeq.sorted if random.nextInt(3) == 0) {
        busy -= context
        resuming += context
      }
    }
    dut.io.visits.valid.expect(false)
  }

  private def check(): Unit = {
    val visit   = dut.io.visits.bits
    val context = visit.context.peekInt().toInt
    assert(visited.contains(context) && !busy(context) && !resuming.contains(context), s"context $context did not ask")
    if (visit.isDone.peekBoolean()) {
      assert(visited(context) == (base until base + records))
      visited -= context
      ended += 1
    } else {
      visit.visit.isLeaf.expect(true)
      visited(context) :+= visit.visit.address.peekInt().toInt
      assert(visited(context).size <= records, s"context $context does not end: ${visited(context)}")
      busy += context
    }
  }
}
