package colonnade.traversal

import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.NodeRecord
import colonnade.{Always, Packed, PackedStreams, PackedUnit, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class BoxUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "BoxUnit"

  private def lanes(config: ColonnadeConfig, count: Int) = config.copy(units = config.units.copy(boxLanes = count))

  private val laneVariants = Seq(lanes(TestConfigs.tiny, 1), lanes(TestConfigs.tiny, 4))

  /** The widest numbers of box tests: fine vertices, padded for narrow divisions. */
  private val widest = {
    val narrow = TestConfigs.withPrecision(16, 16, 16)
    narrow.copy(geometry = narrow.geometry.copy(vertexBits = 24))
  }

  private def shape(config: ColonnadeConfig) =
    s"${config.precision}, ${config.units.boxLanes} lanes"

  for (
    (config, i) <-
      (TestConfigs.formats ++ laneVariants :+ TestConfigs.withExtraSlices(TestConfigs.tiny) :+ widest).zipWithIndex
  )
    it should s"follow the model under random stalls, and keep its lanes busy, format $i (${shape(config)})" taggedAs
      (if (i < TestConfigs.formats.size) Always.ifExtreme(config) else Always) in
      test(new PackedBoxUnit(config)).withAnnotations(Simulation.verilator) { dut =>
        val cases = new BoxStimulus(config, seed = 100 + i)
        compare(dut, config, cases.atBoundaries(20), offered = 1, accepted = 1)
        val ordered = cases.alongRay(40)
        assert(BoxStimulus.falling(config, ordered) > 30, "of 40 cases whose nearest child is not the first one")
        compare(dut, config, ordered, offered = 1, accepted = 0.8)
        for ((offered, accepted) <- Seq((0.4, 1.0), (0.8, 0.3))) compare(dut, config, cases(60), offered, accepted)
        if (!config.units.extraSlices) {
          val nodes  = 40
          val beats  = NodeRecord.most / config.units.boxLanes
          val cycles = compare(dut, config, cases(nodes), offered = 1, accepted = 1)
          assert(cycles == beats * (nodes - 1) + 5 + beats, "lanes are busy without gaps")
        }
      }

  it should "order equally near children by slot, and skip empty ones" in
    test(new PackedBoxUnit(TestConfigs.tiny)) { dut =>
      val config = TestConfigs.tiny
      val around = new BoxStimulus(config, seed = 5)(1).head.copy(
        boxOrigin = Seq.fill(3)(BigInt(1000)),
        tMax = (BigInt(1) << (config.numbers.gridBits - 1)) - 1,
        origin = Seq.fill(3)(BigInt(900)),
        shift = Seq.fill(3)(0),
        low = Seq.fill(4)(Seq.fill(3)(BigInt(0))),
        high = Seq.fill(4)(Seq.fill(3)(BigInt(127)))
      )
      val counts = for (nodes <- 0 to 4; leaves <- 0 to 4 - nodes) yield (nodes, leaves)
      compare(
        dut,
        config,
        counts.map { case (nodes, leaves) => around.copy(nodes = nodes, leaves = leaves) },
        offered = 1,
        accepted = 0.7
      )
    }

  /** @return cycles from the first accepted input to the last result */
  private def compare(
      dut:      PackedBoxUnit,
      config:   ColonnadeConfig,
      cases:    Seq[BoxCase],
      offered:  Double,
      accepted: Double
  ): Int = {
    val input             = new Packed(new BoxCandidate(config))
    val output            = new Packed(new BoxResult(config))
    val solved            = BoxStimulus.solved(config, cases)
    val (results, cycles) =
      PackedStreams.run(dut, solved.map(pair => input.pack(pair._1)), offered, accepted, new Random(11))
    for (((result, (_, expected)), testCase) <- results.zip(solved).zip(cases)) {
      val fields = output.unpack(result)
      for ((name, value) <- expected) assert(fields(name) == value, s"for $name, expected $expected of $testCase")
    }
    cycles
  }
}

private class PackedBoxUnit(config: ColonnadeConfig)
    extends PackedUnit(new BoxCandidate(config), new BoxResult(config)) {
  private val unit = chisel3.Module(new BoxUnit(config))
  unit.io.scene := chisel3.DontCare
  connect(unit.io.in, unit.io.out)
}
