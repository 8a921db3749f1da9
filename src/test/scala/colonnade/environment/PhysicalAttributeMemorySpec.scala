package colonnade.environment

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.config.{ColonnadeConfig, MapEncoding}
import colonnade.formats.{AttributeEvents, Load}
import colonnade.{Always, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** The maps of a device with several marches: a copy in the only column, or copies that columns share. */
private class EnvironmentHarness(config: ColonnadeConfig) extends Module {
  val load    = IO(Flipped(Valid(new Load(config))))
  val columns = Seq.fill(config.array.columns)(Module(new ColumnEnvironment(config)).io)
  val events  = IO(Vec(config.array.columns, Output(new AttributeEvents)))
  columns.foreach(_.load := load)
  events.zip(columns).foreach { case (port, column) => port := column.events }

  for (ports <- columns.flatMap(_.shared).grouped(config.columnsPerCopy)) {
    val tagBits = AttributeArbiter.tagBits(config.mapRequesters)
    val maps    = Module(new PhysicalAttributeMemory(config, ports.size, tagBits))
    maps.io.load := load
    maps.io.ports.zip(ports).foreach { case (port, column) => port <> column }
  }

  /** All channels of each unit. */
  val channels = columns.flatMap(_.ports).map(FlatChannel.all)
}

class PhysicalAttributeMemorySpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PhysicalAttributeMemory"

  private def config(encoding: MapEncoding, marches: Int, columns: Int): ColonnadeConfig = {
    val maps        = TestConfigs.environment.copy(encoding = encoding, columnsPerCopy = 2)
    val environment = TestConfigs.withEnvironment(maps)
    environment.copy(
      array = environment.array.copy(columns = columns),
      units = environment.units.copy(marches = marches)
    )
  }

  import MapEncoding.{Slic, TwoLevel}
  for ((encoding, marches, columns) <- Seq((TwoLevel, 1, 1), (TwoLevel, 10, 1), (Slic, 3, 1), (TwoLevel, 4, 3)))
    it should s"give each march its own responses: $marches marches, $columns columns, ${encoding.name}" taggedAs Always.unless(
      marches == 1
    ) in {
      val count       = 30
      val random      = new Random(marches)
      val shape       = config(encoding, marches, columns)
      val environment = new EnvironmentStimulus(shape, random)
      test(new EnvironmentHarness(shape)).withAnnotations(Simulation.verilator) { dut =>
        environment.load(dut.load, dut.clock)
        val testers = dut.channels.zipWithIndex.map { case (channels, unit) =>
          val exchanges = Seq(
            environment.albedo(count),
            environment.normals(count),
            environment.cells(count),
            environment.planes(count)
          )
          val names = Seq("albedo", "normals", "cells", "planes")
          channels.zip(names.zip(exchanges)).map { case (channel, (name, exchanges)) =>
            // Some units send requests all the time, others now and then
            val offered = if (unit % 3 == 0) 1.0 else 0.1
            new ChannelTester(s"$name of unit $unit", channel, tagBits = 0, exchanges, offered, random)
          }
        }
        var reads            = Seq.fill(4)(0)
        def addReads(): Unit = for (events <- dut.events) {
          val now = Seq(events.albedoReads, events.normalReads, events.cellReads, events.planeReads)
          reads = reads.zip(now).map { case (sum, event) => sum + event.peekInt().toInt }
        }
        ChannelTester.run(dut.clock, testers.flatten, () => addReads())
        assert(reads == Seq.fill(4)(count * (marches + 1) * columns))
      }
    }
}
