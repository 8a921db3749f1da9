package colonnade.background

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.TestConfigs
import colonnade.config.{ColonnadeConfig, MapEncoding}
import colonnade.formats.Load
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** One memory behind a tree of requesters.
  *
  * @param groups requesters of each concentrator before the memory; or none of these, and one requester for each group
  */
private class MemoryHarness(config: ColonnadeConfig, groups: Int, perGroup: Int) extends Module {
  private val tagBits = MemoryHarness.tagBits
  private val isTree  = perGroup > 1
  private val memory  = Module(
    new PhysicalAttributeMemory(config, groups, if (isTree) AttributeArbiter.tagBits(perGroup, tagBits) else tagBits)
  )
  private val leaves = memory.io.ports.flatMap { port =>
    if (isTree) {
      val group = Module(new AttributeConcentrator(config, perGroup, tagBits))
      port <> group.io.served
      group.io.ports.toSeq
    } else Seq(port)
  }

  val load     = IO(Flipped(Valid(new Load(config))))
  val events   = IO(Output(new AttributeEvents))
  val channels = leaves.map { leaf =>
    Seq(FlatChannel(leaf.albedo), FlatChannel(leaf.normals), FlatChannel(leaf.cells), FlatChannel(leaf.planes))
  }
  memory.io.load := load
  events         := memory.io.events
}

private object MemoryHarness {
  val tagBits: Int = 4
}

class PhysicalAttributeMemorySpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "PhysicalAttributeMemory"

  private def config(encoding: MapEncoding): ColonnadeConfig =
    TestConfigs.withRoom(TestConfigs.room.copy(encoding = encoding))

  for {
    encoding           <- MapEncoding.all
    (groups, perGroup) <- Seq((1, 1), (3, 1), (10, 1), (3, 4))
  } it should s"give each of $groups x $perGroup requesters its own answers, ${encoding.name}" in {
    val count  = 60
    val random = new Random(groups)
    val room   = new RoomDialogue(config(encoding), random)
    test(new MemoryHarness(config(encoding), groups, perGroup)).withAnnotations(Seq(VerilatorBackendAnnotation)) {
      memory =>
        room.load(memory.load, memory.clock)
        val testers = memory.channels.zipWithIndex.map { case (channels, requester) =>
          val dialogues = Seq(room.albedo(count), room.normals(count), room.cells(count), room.planes(count))
          val names     = Seq("albedo", "normals", "cells", "planes")
          channels.zip(names.zip(dialogues)).map { case (channel, (name, dialogue)) =>
            // Some ask all the time, others now and then
            val offered = if (requester % 3 == 0) 1.0 else 0.1
            new ChannelTester(s"$name of $requester", channel, MemoryHarness.tagBits, dialogue, offered, random)
          }
        }
        var events = Seq.fill(4)(0)
        val seen   = memory.events
        ChannelTester.run(
          memory.clock,
          testers.flatten,
          () =>
            events = Seq(seen.albedoReads, seen.normalReads, seen.cellReads, seen.planeReads).zip(events).map {
              case (event, sum) => sum + event.peekInt().toInt
            }
        )
        assert(events == Seq.fill(4)(count * groups * perGroup))
    }
  }
}
