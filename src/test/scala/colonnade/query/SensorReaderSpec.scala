package colonnade.query

import chiseltest._
import colonnade.OneSimulation
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Directions of runs equal sums of integers that are rounded once, along rows and in tiles. */
class SensorReaderSpec extends AnyFlatSpec with OneSimulation with Matchers {
  behavior of "SensorReader"

  inOneSimulation(new SensorReader)(
    "make a direction a cycle" -> make(willing = 1),
    "stand still"              -> make(willing = 0.5)
  )

  private def make(willing: Double)(dut: SensorReader): Unit = {
    val random = new Random(3)
    dut.clock.setTimeout(0)
    for (_ <- 0 until 12) {
      val sensor = TestSensor(random)
      sensor.poke(dut.io.sensor)
      val runs = Seq.fill(5) {
        val isTile = random.nextBoolean()
        (
          TestSensor(random).corner,
          if (isTile || random.nextBoolean()) Run.rays else 1 + random.nextInt(Run.rays),
          isTile
        )
      }
      val expected = for ((first, count, isTile) <- runs; index <- 0 until count) yield {
        val (column, row) = TestSensor.positionOf(index, isTile)
        (TestSensor.floats(sensor.sum(first, column, row)), index + 1 == count)
      }
      var (next, taken, cycles) = (0, 0, 0)
      while (taken < expected.size) {
        val offers = next < runs.size && random.nextDouble() < willing
        dut.io.runs.valid.poke(offers)
        if (offers) {
          val (first, count, isTile) = runs(next)
          first.zip(dut.io.runs.bits.dir).foreach { case (from, to) => to.poke(from) }
          dut.io.runs.bits.count.poke(count)
          dut.io.runs.bits.isTile.poke(isTile)
        }
        val accepts = random.nextDouble() < willing
        dut.io.directions.ready.poke(accepts)
        if (dut.io.directions.valid.peekBoolean()) withClue(s"ray $taken of $runs, $sensor: ") {
          (dut.io.directions.bits.map(FloatPorts.peek), dut.io.isLast.peekBoolean()) shouldBe expected(taken)
          if (accepts) taken += 1
        }
        if (offers && dut.io.runs.ready.peekBoolean()) next += 1
        dut.clock.step()
        cycles += 1
        cycles should be < 6 * expected.size + 100
      }
      if (willing == 1) cycles should be <= expected.size + runs.size + 4
      dut.io.runs.valid.poke(false)
      dut.io.directions.ready.poke(true)
      for (_ <- 0 until 8) {
        dut.io.directions.valid.expect(false)
        dut.clock.step()
      }
    }
  }
}
